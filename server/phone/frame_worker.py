"""A thread that looks at one phone's pictures beside the event loop, always at the newest."""

from __future__ import annotations

import atexit
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable

from server.phone.ingest import EncodedFrame

MAX_WAITING = 8
"""Encoded pictures; more, and the stream starts anew at a key frame."""
MAX_ENDING = 8
"""Threads that still look at their last picture; with more, a new one begins when one has ended."""
JOIN_S = 2.0
_alive: set[FrameThread] = set()


class FrameThread(ABC):
    """Pictures go in, nothing queues up: those that waited together are handed over together."""

    def __init__(self, name: str, on_taken: Callable[[int], None]) -> None:
        """`on_taken` runs in this thread; `start` begins."""
        self._on_taken = on_taken
        self._waiting: deque[EncodedFrame] = deque()
        self._condition = threading.Condition()
        self._running = True
        self._has_gap = False
        self.dropped = 0
        self.failed = ""
        """Why the thread died, if it did."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._has_begun = False

    @abstractmethod
    def _look(self, frames: list[EncodedFrame], has_gap: bool) -> None:
        """Decode all of `frames` in order, look at the newest; before them some may be missing."""

    def start(self) -> None:
        """Begin, as soon as there is room for another thread."""
        ending = sum(one.is_ending for one in list(_alive))
        if not self._has_begun and self._running and ending < MAX_ENDING:
            self._has_begun = True
            _alive.add(self)
            self._thread.start()

    def offer(self, frame: EncodedFrame) -> None:
        """A picture has come."""
        with self._condition:
            if len(self._waiting) >= MAX_WAITING:
                self.dropped += len(self._waiting)
                self._waiting.clear()
                self._has_gap = True
            self._waiting.append(frame)
            self._condition.notify()
        if not self._has_begun:
            self.start()

    def stop(self) -> None:
        """End the thread and wait for nobody: what it still looks at reaches nobody.

        `join_all` waits, before the interpreter ends: it can't end a thread that computes in C++.
        """
        with self._condition:
            self._running = False
            self._waiting.clear()
            self._condition.notify()

    def join(self, seconds: float) -> None:
        """Wait for the end of the thread, so long at most."""
        self._thread.join(seconds)

    @property
    def is_ending(self) -> bool:
        """Whether it was stopped."""
        return not self._running

    def _call_if_running(self, callback: Callable[[], object]) -> None:
        """Call, unless the thread was stopped meanwhile."""
        with self._condition:
            if self._running:
                callback()

    def _run(self) -> None:
        try:
            while self._running:
                self._turn()
        except Exception as error:  # the server must say so, not fall silent
            self.failed = f"{self._thread.name} failed: {error!r}"
            raise
        finally:
            _alive.discard(self)

    def _turn(self) -> None:
        with self._condition:
            self._condition.wait_for(lambda: self._waiting or not self._running)
            frames, has_gap = list(self._waiting), self._has_gap
            self._waiting.clear()
            self._has_gap = False
        if not frames:
            return
        self._call_if_running(lambda: self._on_taken(frames[-1].sequence))
        self.dropped += len(frames) - 1
        self._look(frames, has_gap)


def join_all() -> None:
    """Stop what still runs, and wait for it as long as one takes."""
    ending = list(_alive)
    for one in ending:
        one.stop()
    for one in ending:
        one.join(JOIN_S / len(ending))


atexit.register(join_all)
