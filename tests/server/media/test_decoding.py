"""The decoder's own process: the same pictures, and an end that costs nobody else anything."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from hardware.codec import CODECS, DecodeError, Decoder, Encoder
from server.media import decoding as decoding_module
from server.media.decoder_process import FIRST_TO_GO
from server.media.decoding import MEMORY_BYTES, Decoding
from server.phone.decoder import FrameDecoder
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Codec, Picture

WIDTH, HEIGHT = 640, 368
START_S = 60.0
OPEN_FILES = Path("/proc/self/fd")


@pytest.fixture(scope="module")
def decoding() -> Iterator[Decoding]:
    with contextlib.closing(Decoding()) as one:
        yield one


def luma(seed: int) -> np.ndarray:
    grey = np.full((HEIGHT, WIDTH), 30, np.uint8)
    x = 40 + 37 * seed % 500
    grey[100:120, x : x + 20] = 250
    return grey


def eventually(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + START_S
    while not condition():
        assert time.monotonic() < end, "it never came"


def children(pid: int) -> list[int]:
    with contextlib.suppress(OSError):
        return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


BOMB_CPU_S = 0.02
"""Ten times what a flat picture costs a fresh process, most of it page faults, which cost four
times as much on a busy machine; a seventh of a bomb."""


def flat_and_bomb() -> tuple[bytes, bytes]:
    """A picture that is decoded fast, and as many of them in one as are taken."""
    grey = np.full((HEIGHT, WIDTH), 90, np.uint8)
    flat, _ = Encoder(WIDTH, HEIGHT, 30.0, 100_000).encode(grey)
    return flat, flat * (MEMORY_BYTES // len(flat))


@pytest.mark.parametrize("codec", CODECS)
def test_the_same_pictures_come_out_as_of_a_decoder_here(decoding: Decoding, codec: str) -> None:
    encoder = Encoder(WIDTH, HEIGHT, 30.0, 2_000_000, codec)
    here, there = Decoder(codec, WIDTH, HEIGHT), decoding.open(codec, WIDTH, HEIGHT)
    assert there.full_range == here.full_range
    for seed in range(5):
        data, _ = encoder.encode(luma(seed))
        assert np.array_equal(there.decode(data), here.decode(data))


def test_streams_of_several_owners_do_not_touch_each_other(decoding: Decoding) -> None:
    encoders = [Encoder(WIDTH, HEIGHT, 30.0, 2_000_000) for _ in range(2)]
    here = [Decoder("h264", WIDTH, HEIGHT) for _ in range(2)]
    there = [decoding.open("h264", WIDTH, HEIGHT) for _ in range(2)]
    kept = []
    for seed in range(4):
        data, _ = encoders[seed % 2].encode(luma(seed))
        kept.append((there[seed % 2].decode(data), here[seed % 2].decode(data).copy()))
    assert all(np.array_equal(one, other) for one, other in kept)


def test_garbage_is_refused_and_the_process_lives(decoding: Decoding) -> None:
    there = decoding.open("h264", WIDTH, HEIGHT)
    deaths = decoding.deaths
    for data in (b"", b"\0" * 100, os.urandom(2_000)):
        with pytest.raises(DecodeError):
            there.decode(data)
    assert decoding.deaths == deaths


def test_an_unknown_codec_is_refused_here(decoding: Decoding) -> None:
    with pytest.raises(ValueError, match="h266"):
        decoding.open("h266", WIDTH, HEIGHT)


def test_a_bomb_ends_the_decoder_alone_by_its_processor_time_and_the_next_key_is_seen() -> None:
    flat, bomb = flat_and_bomb()
    with contextlib.closing(Decoding(cpu_s=BOMB_CPU_S)) as decoding:
        pid = decoding.pid
        eye = FrameDecoder(WIDTH, HEIGHT, decoding.open)
        sent = flat, bomb, flat
        pictures = [Picture(Codec.H264, True, WIDTH, HEIGHT, 0, data) for data in sent]
        seen = [eye.decoded(EncodedFrame(0.0, 0.0, n, p)) for n, p in enumerate(pictures)]
        assert [luma is None for luma in seen] == [False, True, False]
        assert (eye.undecodable, decoding.deaths, decoding.pid) == (1, 1, pid)
        assert "(1)" in decoding.news(100.0)
        assert decoding.news(200.0) == ""


def test_its_memory_is_limited_and_it_writes_no_files(decoding: Decoding) -> None:
    decoding.open("jpeg", WIDTH, HEIGHT).decode(
        Encoder(WIDTH, HEIGHT, 30.0, 1, "jpeg").encode(luma(0))[0]
    )
    assert decoding.pid is not None
    (child,) = children(decoding.pid)
    lines = Path(f"/proc/{child}/limits").read_text().splitlines()
    limits = {line[:26].strip(): line[26:].split()[0] for line in lines}
    assert int(limits["Max address space"]) < 4 << 30
    assert limits["Max file size"] == limits["Max core file size"] == "0"


def test_one_that_is_only_given_no_time_is_waited_for(decoding: Decoding) -> None:
    there = decoding.open("jpeg", WIDTH, HEIGHT)
    data, _ = Encoder(WIDTH, HEIGHT, 30.0, 1, "jpeg").encode(luma(0))
    there.decode(data)
    assert decoding.pid is not None
    (child,) = children(decoding.pid)
    deaths = decoding.deaths
    os.kill(child, signal.SIGSTOP)
    with ThreadPoolExecutor(1) as pool:
        picture = pool.submit(there.decode, data)
        os.kill(child, signal.SIGCONT)
        assert picture.result().shape == (HEIGHT, WIDTH)
    assert decoding.deaths == deaths


@pytest.mark.parametrize("which", ["child", "parent"])
def test_one_that_is_killed_costs_a_picture_at_most_and_no_answer_goes_astray(which: str) -> None:
    with contextlib.closing(Decoding()) as decoding:
        there = decoding.open("jpeg", WIDTH, HEIGHT)
        data = [Encoder(WIDTH, HEIGHT, 30.0, 1, "jpeg").encode(luma(n))[0] for n in range(4)]
        here = [Decoder("jpeg", WIDTH, HEIGHT).decode(one) for one in data]
        there.decode(data[0])
        assert decoding.pid is not None
        (child,) = children(decoding.pid)
        os.kill(child if which == "child" else decoding.pid, signal.SIGKILL)
        lost = 0
        for one, luma_here in zip(data, here, strict=True):
            try:
                assert np.array_equal(there.decode(one), luma_here)
            except DecodeError:
                lost += 1
        assert lost <= (which == "parent")


def test_a_picture_asked_for_while_its_decoder_is_dead_is_the_next_ones(
    decoding: Decoding,
) -> None:
    """Given up, it would be decoded all the same, and its picture written over the next."""
    there = decoding.open("jpeg", WIDTH, HEIGHT)
    data = [Encoder(WIDTH, HEIGHT, 30.0, 1, "jpeg").encode(luma(n))[0] for n in range(3)]
    here = [Decoder("jpeg", WIDTH, HEIGHT).decode(one) for one in data]
    there.decode(data[0])
    parent, deaths = decoding.pid, decoding.deaths
    assert parent is not None
    (child,) = children(parent)
    os.kill(parent, signal.SIGSTOP)
    os.kill(child, signal.SIGKILL)
    with ThreadPoolExecutor(1) as pool:
        picture = pool.submit(there.decode, data[1])
        time.sleep(0.1)  # it has been asked for
        os.kill(parent, signal.SIGCONT)
        assert np.array_equal(picture.result(), here[1])
    assert np.array_equal(there.decode(data[2]), here[2])
    assert decoding.deaths == deaths


class Starts:
    """Processes that can't be started, or end at once."""

    def __init__(self) -> None:
        self.t, self.at = 0.0, list[float]()
        self.error: OSError | None = None

    def __call__(self, cpu_s: float) -> Starts:
        self.at.append(self.t)
        if self.error is not None:
            raise self.error
        return self

    def ask(self, *request: object) -> int:
        raise ConnectionError("the decoder has gone")

    def close(self) -> None: ...


@pytest.mark.parametrize("error", [None, OSError(errno.EMFILE, "Too many open files")])
def test_one_that_ends_each_time_or_can_not_begin_is_started_ever_more_seldom(
    monkeypatch: pytest.MonkeyPatch, error: OSError | None
) -> None:
    starts = Starts()
    monkeypatch.setattr(decoding_module, "_Running", starts)
    decoding = Decoding(clock=lambda: starts.t)
    starts.error = error
    there = decoding.open("jpeg", WIDTH, HEIGHT)
    for tenth in range(200):
        starts.t = 0.1 * tenth
        with pytest.raises(DecodeError):
            there.decode(b"x")
    waits = np.diff(starts.at[1:])
    assert waits == pytest.approx([0.2, 0.5, 1.0, 2.0, 5.0, 5.0, 5.0], abs=0.21)


def test_a_start_without_file_handles_leaves_none_open(monkeypatch: pytest.MonkeyPatch) -> None:
    def poor(*arguments: object, **options: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(subprocess, "Popen", poor)
    before = len(list(OPEN_FILES.iterdir()))
    with pytest.raises(OSError, match="Too many"):
        decoding_module._Running(1.0)
    assert len(list(OPEN_FILES.iterdir())) == before


def test_what_ends_the_decoder_but_is_no_fault_of_a_picture_is_told() -> None:
    script = (
        "import mmap, os, socket; from server.media import decoder_process as d;"
        "a, b = socket.socketpair(); a.sendall(d.REQUEST.pack(1, 1, 99, 64, 64, 0));"
        "d._decode_for_ever(os.getppid(), b, mmap.mmap(-1, 4096), mmap.mmap(-1, 4), 1.0)"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, timeout=START_S)
    assert ended.returncode == 1
    assert b"IndexError" in ended.stderr


def test_when_memory_is_short_it_goes_first(decoding: Decoding) -> None:
    decoding.open("jpeg", WIDTH, HEIGHT).decode(
        Encoder(WIDTH, HEIGHT, 30.0, 1, "jpeg").encode(luma(0))[0]
    )
    own = int(Path("/proc/self/oom_score_adj").read_text())
    assert int(Path(f"/proc/{decoding.pid}/oom_score_adj").read_text()) == FIRST_TO_GO > own


def test_when_the_server_is_killed_they_end(tmp_path: Path) -> None:
    script = (
        "import sys, time; from server.media.decoding import Decoding; d = Decoding();"
        "d.open('jpeg', 64, 64); print(d.pid, flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        assert server.stdout is not None
        pid = int(server.stdout.readline())
        eventually(lambda: bool(children(pid)))
        both = [pid, *children(pid)]
        server.kill()
        eventually(lambda: not any(map(is_running, both)))


def is_running(pid: int) -> bool:
    """Alive, and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
