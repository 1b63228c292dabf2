"""VisionThread: the newest picture wins, every picture is given back, and a death is told."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from pipeline.signals import Match, Spots
from pipeline.vision.detection import Detection
from pipeline.vision.rays import NO_RAYS
from server.phone import frame_worker
from server.phone.frame_worker import MAX_WAITING
from server.phone.ingest import EncodedFrame
from server.phone.vision_thread import THUMBNAIL_WIDTH, VisionThread, draw, jpeg
from server.protocol.wire_records import Codec, Picture

NO_SPOTS = Spots(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))


def frame(sequence: int, key: bool = False) -> EncodedFrame:
    picture = Picture(Codec.H264, key, 64, 48, 0, b"x")
    return EncodedFrame(0.03 * sequence, 0.03 * sequence + 0.1, sequence, picture)


class Eyes:
    """A `FramePipeline` that waits for permission before each look."""

    def __init__(self) -> None:
        self.needs_key = True
        self.undecodable = 0
        self.luma = np.zeros((48, 64), dtype=np.uint8)
        self.looks: list[tuple[list[int], bool]] = []
        self.may = threading.Semaphore(0)
        self.front_end = threading.Semaphore(0)
        self.fails = False

    def see(self, frames: list[EncodedFrame]) -> Detection | None:
        self.front_end.release()
        assert self.may.acquire(timeout=5.0)
        if self.fails:
            raise ZeroDivisionError("no light")
        self.looks.append(([f.sequence for f in frames], self.needs_key))
        if self.needs_key and not frames[0].picture.key:
            return None
        self.needs_key = False
        return Detection(frames[-1].t, None, NO_RAYS, NO_SPOTS, None, "Nothing.")


class Rig:
    def __init__(self) -> None:
        self.eyes = Eyes()
        self.seen: list[int] = []
        self.taken: list[int] = []
        self.keys_wanted = 0
        self.thread = VisionThread(
            self.eyes,
            lambda _, newest: self.seen.append(newest.sequence),
            self.taken.append,
            self._want_key,
        )

    def _want_key(self) -> None:
        self.keys_wanted += 1

    def begin_look(self) -> None:
        assert self.eyes.front_end.acquire(timeout=5.0)


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    for _ in range(50):
        made.eyes.may.release()
    made.thread.stop()
    made.thread._thread.join(5.0)


def eventually(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def test_what_came_during_a_look_is_decoded_in_order_and_only_the_newest_is_looked_at(rig):
    rig.thread.offer(frame(1, key=True))
    rig.begin_look()
    for sequence in (2, 3, 4):
        rig.thread.offer(frame(sequence))
    rig.eyes.may.release()
    rig.begin_look()
    rig.eyes.may.release()
    eventually(lambda: rig.seen == [1, 4])
    assert [look for look, _ in rig.eyes.looks] == [[1], [2, 3, 4]]
    assert rig.taken == [1, 4]
    assert rig.thread.dropped == 2


def test_after_an_overflow_nothing_is_decoded_before_a_key_frame(rig):
    rig.thread.offer(frame(1, key=True))
    rig.begin_look()
    for sequence in range(2, MAX_WAITING + 3):
        rig.thread.offer(frame(sequence))
    rig.eyes.may.release()
    rig.begin_look()
    rig.eyes.may.release()
    eventually(lambda: rig.keys_wanted == 1)
    assert rig.eyes.looks == [([1], True), ([MAX_WAITING + 2], True)]
    rig.thread.offer(frame(50, key=True))
    rig.begin_look()
    rig.eyes.may.release()
    eventually(lambda: rig.seen == [1, 50])
    assert rig.thread.dropped == MAX_WAITING


def test_what_cannot_be_decoded_asks_for_a_key_frame(rig):
    rig.thread.offer(frame(1))
    rig.begin_look()
    rig.eyes.may.release()
    eventually(lambda: rig.keys_wanted == 1)
    assert rig.seen == []
    assert rig.taken == [1]


def test_thumbnails_are_made_only_while_somebody_watches(rig):
    for sequence, watched in ((1, False), (2, True)):
        rig.thread.watched = watched
        rig.thread.offer(frame(sequence, key=True))
        rig.begin_look()
        rig.eyes.may.release()
        eventually(lambda: len(rig.seen) == sequence)  # noqa: B023
        assert watched or rig.thread.thumbnail is None
    eventually(lambda: rig.thread.thumbnail is not None)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_thread_that_dies_says_why(rig):
    rig.eyes.fails = True
    rig.thread.offer(frame(1, key=True))
    rig.begin_look()
    rig.eyes.may.release()
    eventually(lambda: rig.thread.failed != "")
    assert "no light" in rig.thread.failed


def test_who_stops_a_thread_waits_for_nobody_and_hears_no_more_of_it(rig, monkeypatch):
    rig.thread.offer(frame(1, key=True))
    rig.begin_look()
    with monkeypatch.context() as patched:
        patched.delattr(threading.Thread, "join")
        rig.thread.stop()
    assert rig.thread in frame_worker._alive
    taken = list(rig.taken)
    rig.eyes.may.release()
    rig.thread._thread.join(5.0)
    assert (rig.seen, rig.taken, rig.keys_wanted) == ([], taken, 0)
    assert rig.thread not in frame_worker._alive


def test_phones_that_come_and_go_leave_no_threads_behind_even_if_each_leaves_a_long_look():
    before, rigs = threading.active_count(), []
    for _ in range(100):
        rigs.append(Rig())
        rigs[-1].thread.offer(frame(1, key=True))
        if rigs[-1].thread._has_begun:
            rigs[-1].begin_look()
        rigs[-1].thread.stop()
        assert threading.active_count() <= before + frame_worker.MAX_ENDING
    for one in rigs:
        one.eyes.may.release()
    eventually(lambda: threading.active_count() == before)
    assert not frame_worker._alive
    assert not any(one.seen for one in rigs)


def test_a_phone_that_comes_while_many_threads_end_is_seen_once_there_is_room():
    rigs = [Rig() for _ in range(frame_worker.MAX_ENDING)]
    for one in rigs:
        one.thread.offer(frame(1, key=True))
        one.begin_look()
        one.thread.stop()
    newest = Rig()
    newest.thread.offer(frame(1, key=True))
    assert not newest.thread._has_begun
    for one in rigs:
        one.eyes.may.release()
    eventually(lambda: not frame_worker._alive)
    newest.thread.offer(frame(2))
    newest.begin_look()
    newest.eyes.may.release()
    eventually(lambda: newest.seen == [2])
    newest.thread.stop()


LOOKS_LONG = """
import threading, time
from server.phone.frame_worker import FrameThread
looks = threading.Event()
class Eyes(FrameThread):
    def _look(self, frames, has_gap):
        looks.set()
        time.sleep(0.3)
        print("has looked", flush=True)
eyes = Eyes("eyes", lambda n: None)
eyes.start()
eyes.offer(type("Frame", (), {"sequence": 1}))
looks.wait()
eyes.stop()
"""


def test_the_interpreter_ends_after_the_last_look():
    words = [sys.executable, "-c", LOOKS_LONG]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    assert (done.stdout, done.stderr) == ("has looked\n", "")


def test_found_lights_and_others_are_circled_in_different_colours():
    luma = np.zeros((720, 1280), dtype=np.uint8)
    pixels = np.array([[320.0, 360.0], [960.0, 360.0]])
    spots = Spots(pixels, np.zeros((2, 2, 2)), np.ones(2), np.ones(2))
    match = Match(np.array([0]), np.array([1]))
    picture = draw(luma, Detection(0.0, None, NO_RAYS, spots, match, ""))
    assert picture.shape == (270, THUMBNAIL_WIDTH, 3)
    left, right = picture[:, :240].reshape(-1, 3), picture[:, 240:].reshape(-1, 3)
    assert left.sum(axis=0).argmax() == 0
    assert right.sum(axis=0).argmax() == 1
    assert jpeg(picture).startswith(b"\xff\xd8")
