"""Garbage collection that no flight waits for, and how long the longest one took.

A full collection visits every object of a process and stops all its threads: 0.1-0.3 s for the
200 000 and more of the server, while control bears 0.15 s without news. So what a process needs for
ever is frozen, which means never visited again, and the old generation is collected by
`Garbage.tick` alone: when it has grown a little, which takes milliseconds.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
from collections.abc import Callable, Iterator

MOST_NEW = 20_000
"""Objects that grow old between two collections, and old ones that may live on unfrozen: twice as
many are visited together, in some 3-10 ms."""
NEVER = 1_000_000
"""Young collections before Python itself would begin a full one: weeks."""
MOST_FROZEN_LATELY = 200_000
"""Objects, since all were visited. Beyond it, and when nobody leads, all are visited again: some of
what was frozen will have become garbage."""
IDLE_TICKS = 20
"""So often idle after use all are visited, too: few objects may hold much memory outside Python, as
those of a WebRTC connection its ciphers (0.2 MB)."""


class Garbage:
    """Collects one process's garbage in small parts, and measures every collection in it."""

    def __init__(self, cpu: Callable[[], float]) -> None:
        """`cpu()`: processor time of the calling thread [s]; the machine's holes are not in it."""
        self._cpu = cpu
        self._began = 0.0
        self._frozen_lately, self._most_old = 0, MOST_NEW
        self._idle_ticks = IDLE_TICKS
        self.counts = False
        """Whether a robot is armed: of other times nothing is kept."""
        self.longest_s = 0.0
        """Of the collections that counted since `reset` [s]."""
        self.count = 0
        """Of these, those that took all three generations."""
        self._former: tuple[int, int, int] | None = None
        """Python's own thresholds, once settled."""

    def close(self) -> None:
        """Leave everything to Python again."""
        if self._former is not None:
            gc.callbacks.remove(self._observe)
            gc.set_threshold(*self._former)
            gc.unfreeze()
            self._former = None

    def reset(self) -> None:
        """Begin to count anew."""
        self.longest_s, self.count = 0.0, 0

    def settle(self) -> None:
        """Collect everything, give free memory back and freeze what is left.

        Takes long, so do it while nobody flies.
        """
        if self._former is None:
            self._former = gc.get_threshold()
            gc.set_threshold(*self._former[:2], NEVER)
            gc.callbacks.append(self._observe)
        gc.unfreeze()
        gc.collect()
        gc.freeze()
        _give_back()
        self._frozen_lately, self._most_old = 0, MOST_NEW

    def tick(self, idle: bool) -> None:
        """Collect if enough has gathered; call it some ten times a second.

        `idle`: nobody could mind if it took long. Before `settle` Python goes its own way.
        """
        if self._former is None:
            return
        self._idle_ticks = self._idle_ticks + 1 if idle else 0
        has_left = self._idle_ticks == IDLE_TICKS
        if idle and (has_left or self._frozen_lately > MOST_FROZEN_LATELY):
            self.settle()
            return
        if _old() <= self._most_old:
            return
        gc.collect()
        lives = _old()
        if lives > MOST_NEW:
            gc.freeze()
            self._frozen_lately, lives = self._frozen_lately + lives, 0
        self._most_old = lives + MOST_NEW

    def _observe(self, phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            self._began = self._cpu()
        elif self.counts:
            self.longest_s = max(self.longest_s, self._cpu() - self._began)
            self.count += info["generation"] == 2


def _give_back() -> None:
    """Let the system have the memory that is free, where the C library can (malloc_trim(3), glibc).

    By itself it keeps all that lies below what is still in use: decoders, ciphers and codecs of one
    flight after another leave holes among what lives on, and the process would grow by them.
    """
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _old() -> int:
    """Number of objects that the next full collection would visit beside the young ones."""
    return len(gc.get_objects(generation=2))


@contextlib.contextmanager
def held() -> Iterator[None]:
    """No collection at all meanwhile, for a program that measures for a minute or so."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
