"""Keeping 200 Hz: scheduling class, locked memory, absolute schedule, and how well it holds."""

from __future__ import annotations

import ctypes
import gc
import os
import time

import numpy as np

from server.common import clock

FIFO_PRIORITY = 50  # as the kernel's own interrupt threads
GRANTED = "SCHED_FIFO"
"""How `claim` begins when it got what it asked for."""
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
"""Linux: what is there, what will be, and of both only what is touched. Without the last one every
library's unused part is read in and kept: 549 MB in place of 216."""


def claim() -> str:
    """Ask for SCHED_FIFO and locked memory, without garbage collection; says what was granted."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
    except (AttributeError, PermissionError, OSError):
        return "timing degraded: SCHED_FIFO was not permitted (needs CAP_SYS_NICE)"
    return f"{GRANTED} {FIFO_PRIORITY}" + ("" if lock_memory() else ", memory not locked")


def lock_memory() -> bool:
    """Keep what this process has touched, and will touch, in memory; whether that was granted.

    To be called when all that is used was used once.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    wanted = MCL_CURRENT | MCL_FUTURE
    return any(libc.mlockall(flags) == 0 for flags in (wanted | MCL_ONFAULT, wanted))


class Schedule:
    """Wakes at t0, t0 + period, …: lateness does not add up; late and missed ticks count."""

    def __init__(self, period: float, window: int = 12_000) -> None:
        """Ticks every `period` [s]; statistics over the last `window` ticks."""
        self.period = period
        self._next = clock.now() + period
        self._lateness = np.zeros(window)
        self.ticks = 0
        self.missed = 0
        """Ticks that never ran because one before them took too long."""

    def wait(self) -> float:
        """Sleep until the next tick is due; gives the time now [s, monotonic]."""
        delay = self._next - clock.now()
        if delay > 0.0:
            time.sleep(delay)
        now = clock.now()
        late = now - self._next
        self._lateness[self.ticks % len(self._lateness)] = late
        self.ticks += 1
        skipped = int(late / self.period)
        self.missed += skipped
        self._next += (skipped + 1) * self.period
        return now

    def lateness_ms(self) -> dict[str, float]:
        """p50, p99, p99.9 and worst lateness of the window [ms], and all missed ticks."""
        seen = self._lateness[: min(self.ticks, len(self._lateness))]
        if not len(seen):
            return {}
        p50, p99, p999 = 1e3 * np.percentile(seen, (50.0, 99.0, 99.9))
        return {
            "p50": round(float(p50), 3),
            "p99": round(float(p99), 3),
            "p999": round(float(p999), 3),
            "max": round(1e3 * float(seen.max()), 3),
            "missed": float(self.missed),
        }
