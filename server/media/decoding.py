"""The server's end of the process that decodes: a phone's pictures can end that, and no more."""

from __future__ import annotations

import contextlib
import logging
import mmap
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import Protocol

import numpy as np

from hardware.codec import CODECS, DecodeError
from pipeline.signals import Image
from server.common.child import BACKOFF_S, STEADY_S, be_ordinary
from server.common.clock import now
from server.media.decoder_process import ANSWER, DECODED, DIED, REFUSED, REQUEST
from server.protocol.wire import MAX_PIXELS, MAX_RECORD_BYTES

MEMORY_BYTES = max(MAX_PIXELS, MAX_RECORD_BYTES)
START_S, PATIENCE_S = 60.0, 5.0
"""For the first answer, and for any other: a process that stands still is given up. What computes
for long is ended by its processor time."""
PICTURE_CPU_S = 0.25
"""One of two megapixels takes a tenth of it."""
SAY_AGAIN_S = 5.0
AGAIN_S = (0.0, *BACKOFF_S)
"""One that was steady costs a picture and no more: the first start anew is at once."""
MAX_NUMBER = 0xFFFFFFFF  # of a request, as wide as its field
log = logging.getLogger("lightleash")


class AnyDecoder(Protocol):
    """Decoder of one stream of one size; see `hardware.codec.Decoder`."""

    codec: str

    @property
    def full_range(self) -> bool:
        """Whether luma reaches from 0 to 255."""

    def decode(self, data: bytes) -> Image:
        """Luma (height, width); DecodeError for what is no such picture."""


MakeDecoder = Callable[[str, int, int], AnyDecoder]


class _Running:
    """One decoder process, with its socket and memory."""

    def __init__(self, cpu_s: float) -> None:
        """OSError: there are no handles, or there is no memory, for it."""
        with contextlib.ExitStack() as theirs, contextlib.ExitStack() as ours:
            self.channel, other = socket.socketpair()
            ours.callback(self.channel.close)
            theirs.callback(other.close)
            self.channel.settimeout(START_S)
            self._unread = select.poll()  # not select(), which knows 1024 files
            self._unread.register(self.channel, select.POLLIN)
            descriptor = _memory(theirs)
            self.memory = mmap.mmap(descriptor, MEMORY_BYTES)
            numbers = other.fileno(), descriptor
            command = [sys.executable, "-m", "server.media.decoder_process"]
            self.process = subprocess.Popen(
                [*command, *map(str, (*numbers, MEMORY_BYTES, cpu_s))],
                pass_fds=numbers,
                start_new_session=True,
                stdin=subprocess.DEVNULL,
                stdout=sys.stderr,
            )
            be_ordinary(self.process.pid)
            ours.pop_all()

    def ask(self, request: bytes, number: int, data: bytes) -> int:
        """What became of a picture.

        Raises:
            OSError: there is no answer.
        """
        while self._unread.poll(0):  # words of one that ended unasked
            self._answer()
        self.memory[: len(data)] = data
        self.channel.sendall(request)
        while True:
            of, became = self._answer()
            if of == number:
                return became

    def _answer(self) -> tuple[int, int]:
        answer = self.channel.recv(ANSWER.size, socket.MSG_WAITALL)
        if len(answer) != ANSWER.size:
            raise ConnectionError("the decoder has gone")
        self.channel.settimeout(PATIENCE_S)
        number, became = ANSWER.unpack(answer)
        return number, became

    def close(self) -> None:
        """End it: it sees that the socket is closed; what stands still is killed."""
        self.channel.close()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def _memory(until: contextlib.ExitStack) -> int:
    """A descriptor of shared memory, open `until` then; of a file where there is no other."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("lightleash-pictures")
        until.callback(os.close, descriptor)
    else:
        file = until.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        descriptor = file.fileno()
    os.ftruncate(descriptor, MEMORY_BYTES)
    return descriptor


class Decoding:
    """A process that decodes for everybody, one picture at a time; started anew when it ends."""

    def __init__(self, cpu_s: float = PICTURE_CPU_S, clock: Callable[[], float] = now) -> None:
        """Started, to be ready when pictures come; `cpu_s` is the processor time of one [s]."""
        self._cpu_s, self._clock = cpu_s, clock
        self._failures, self._started, self._due = 0, clock(), 0.0
        self._lock = threading.Lock()
        self._streams = self._asked = 0
        self._running: _Running | None = _Running(cpu_s)
        self.refused = self.deaths = 0
        """Pictures that it read and could not decode; that ended it."""
        self._reported, self._t_reported = 0, -float("inf")

    @property
    def pid(self) -> int | None:
        """Id of the process that forks."""
        return self._running.process.pid if self._running is not None else None

    def open(self, codec: str, width: int, height: int) -> AnyDecoder:
        """A decoder of one stream of one size.

        Raises:
            ValueError: an unknown codec.
        """
        if codec not in CODECS:
            raise ValueError(f"codec: {codec!r} is not one of {', '.join(CODECS)}")
        with self._lock:
            self._streams += 1
            return RemoteDecoder(self, self._streams, codec, width, height)

    def news(self, t: float) -> str:
        """News for people at `t` [s], or ""."""
        new = self.deaths - self._reported
        if not new or t < self._t_reported + SAY_AGAIN_S:
            return ""
        self._reported, self._t_reported = self.deaths, t
        return f"Pictures of the phone ended their decoder ({new}): another one goes on."

    def decode(self, stream: int, codec: int, width: int, height: int, data: bytes) -> Image | None:
        """Luma (height, width), or None: it can't be decoded, or it ended the process."""
        if len(data) > MEMORY_BYTES or width * height > MAX_PIXELS:
            return None
        with self._lock:
            if self._running is None and not self._start():
                return None
            assert self._running is not None
            self._asked = self._asked % MAX_NUMBER + 1
            request = REQUEST.pack(self._asked, stream, codec, width, height, len(data))
            try:
                became = self._running.ask(request, self._asked, data)
            except OSError:  # it has gone, or stands still
                self._running.close()
                self._running, became = None, DIED
                self._wait_to_start()
            self.refused += became == REFUSED
            self.deaths += became == DIED
            if self._running is None or became != DECODED:
                return None
            luma = np.frombuffer(self._running.memory, np.uint8, width * height)
            return luma.reshape(height, width).copy()  # the next picture will lie there

    def _start(self) -> bool:
        """Whether it is started anew: one that ends each time, or can't begin, waits longer."""
        t = self._clock()
        if t < self._due:
            return False
        self._started = t
        try:
            self._running = _Running(self._cpu_s)
        except OSError as error:
            log.error("can't start the decoder of pictures: %s; trying again", error.strerror)
            self._wait_to_start()
            return False
        return True

    def _wait_to_start(self) -> None:
        t = self._clock()
        if t - self._started > STEADY_S:
            self._failures = 0
        self._due = t + AGAIN_S[min(self._failures, len(AGAIN_S) - 1)]
        self._failures += 1

    def close(self) -> None:
        """End the process."""
        with self._lock:
            if self._running is not None:
                self._running.close()
                self._running = None


class RemoteDecoder:
    """`hardware.codec.Decoder`, elsewhere."""

    def __init__(
        self, decoding: Decoding, stream: int, codec: str, width: int, height: int
    ) -> None:
        """Begin with nothing decoded."""
        self.codec = codec
        self._decoding, self._stream = decoding, stream
        self._size = width, height

    @property
    def full_range(self) -> bool:
        """Whether luma reaches from 0 to 255."""
        return self.codec == "jpeg"

    def decode(self, data: bytes) -> Image:
        """Luma (height, width) of a picture.

        Raises:
            DecodeError: not decodable, or it ended the process.
        """
        luma = self._decoding.decode(self._stream, CODECS.index(self.codec), *self._size, data)
        if luma is None:
            raise DecodeError(f"no {self.codec} picture of this stream")
        return luma
