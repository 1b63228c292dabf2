"""VisionThread: the newest picture wins, every picture is given back, and a death is told."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from pipeline.signals import Match, Spots
from pipeline.vision.rays import NO_RAYS
from pipeline.vision.sighting import Sighting
from server.frame_thread import MAX_WAITING
from server.ingest import EncodedFrame
from server.vision import THUMBNAIL_WIDTH, VisionThread, draw, jpeg
from server.wire_records import Codec, Picture

NO_SPOTS = Spots(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))


def frame(sequence: int, key: bool = False) -> EncodedFrame:
    picture = Picture(Codec.H264, key, 64, 48, 0, b"x")
    return EncodedFrame(0.03 * sequence, 0.03 * sequence + 0.1, sequence, picture)


class Eyes:
    """A `Sight` that waits for permission before each look."""

    def __init__(self) -> None:
        self.needs_key = True
        self.undecodable = 0
        self.luma = np.zeros((48, 64), dtype=np.uint8)
        self.looks: list[tuple[list[int], bool]] = []
        self.may = threading.Semaphore(0)
        self.looking = threading.Semaphore(0)
        self.fails = False

    def feel(self, sample: object) -> None: ...

    def see(self, frames: list[EncodedFrame], up: object, omega: object) -> Sighting | None:
        self.looking.release()
        assert self.may.acquire(timeout=5.0)
        if self.fails:
            raise ZeroDivisionError("no light")
        self.looks.append(([f.sequence for f in frames], self.needs_key))
        if self.needs_key and not frames[0].picture.key:
            return None
        self.needs_key = False
        return Sighting(frames[-1].t, None, NO_RAYS, NO_SPOTS, None, "Nothing.")


class Rig:
    def __init__(self) -> None:
        self.eyes = Eyes()
        self.seen: list[int] = []
        self.taken: list[int] = []
        self.keys_wanted = 0
        self.thread = VisionThread(
            self.eyes,  # type: ignore[arg-type]
            lambda _, newest: self.seen.append(newest.sequence),
            self.taken.append,
            self._want_key,
        )

    def _want_key(self) -> None:
        self.keys_wanted += 1

    def begin_look(self) -> None:
        assert self.eyes.looking.acquire(timeout=5.0)


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    for _ in range(50):
        made.eyes.may.release()
    made.thread.stop()


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


def test_found_lights_and_others_are_circled_in_different_colours():
    luma = np.zeros((720, 1280), dtype=np.uint8)
    pixels = np.array([[320.0, 360.0], [960.0, 360.0]])
    spots = Spots(pixels, np.zeros((2, 2, 2)), np.ones(2), np.ones(2))
    match = Match(np.array([0]), np.array([1]))
    picture = draw(luma, Sighting(0.0, None, NO_RAYS, spots, match, ""))
    assert picture.shape == (270, THUMBNAIL_WIDTH, 3)
    left, right = picture[:, :240].reshape(-1, 3), picture[:, 240:].reshape(-1, 3)
    assert left.sum(axis=0).argmax() == 0
    assert right.sum(axis=0).argmax() == 1
    assert jpeg(picture).startswith(b"\xff\xd8")
