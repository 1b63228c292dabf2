"""How slow this machine's processor is, beside that on which real flights' bounds were measured.

A flight in real time, its browser, pictures, server and robot share two processors, which suffice
for less where the same work takes longer. CPU time is measured, of work that never changes: who
waits for a processor does not count, nor what the project itself costs. No bound follows from it.

A flight for which a weak machine had no processor left proves nothing, and is tried again: neither
alone is an excuse. Strong machines are not kept busy but by our own fault, and on a weak one with
processors to spare nothing that we do is late by it.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np

STEPS = 4_000
REFERENCE_S = 0.0077
"""Inferred, not measured there: it took 15-25 ms where the plain numpy of `bench_relative` took
2.7-3.3 ms of CPU, and that took 1.122 ms where docs/bench/estimation.md was made."""
TRIES = 9
WEAK: Final = 1.8
"""Times as long as there, and a machine is weak."""
SPARE: Final = 0.08
"""Share of its processors' time: with less left, somebody waited for one again and again."""
SLOW_MOTION: Final = "SLOW_MOTION"
"""In a process's environment: how many of the world's seconds one of its own takes, where it lives
in slow motion (`tests.slow_motion`)."""
STAT, IDLE = Path("/proc/stat"), (4, 5)
"""Since its start, all processors together, in 1/100 s: those without work, and those whose work
waits for a disk (proc(5))."""


def _work() -> None:
    P, Phi = np.eye(9), np.eye(9) + 1e-4 * np.ones((9, 9))
    for _ in range(STEPS):
        P = Phi @ P @ Phi.T
        P /= P[0, 0]


def slowness() -> float:
    """How many times as long work takes here, now, as where bounds were measured; at least 1."""
    took = []
    for _ in range(TRIES):
        began = time.thread_time()
        _work()
        took.append(time.thread_time() - began)
    return max(1.0, median(took) / REFERENCE_S)


def own_s(world_s: float) -> float:
    """What the kernel tells [s], which is in the world's time, in that of this process."""
    return world_s / float(os.environ.get(SLOW_MOTION, "1"))


def _idle_s() -> float:
    """What its processors had nothing to do since its start [s], together; NaN: nobody tells."""
    try:
        told = STAT.read_text().split("\n", 1)[0].split()
    except OSError:
        return float("nan")
    return own_s(sum(int(told[k]) for k in IDLE) / os.sysconf("SC_CLK_TCK"))


class Load:
    """Whether a machine had what was asked of it, since this was made."""

    def __init__(self) -> None:
        """From now on."""
        self._began, self._idle_s = time.monotonic(), _idle_s()

    @property
    def spare(self) -> float:
        """Share of its processors' time that nobody wanted; NaN if nobody tells."""
        took_s = (os.cpu_count() or 1) * (time.monotonic() - self._began)
        return (_idle_s() - self._idle_s) / took_s


def overload(slow: float, spare: float) -> str:
    """Words if a machine was too weak for what it was asked, by its slowness and what it spared."""
    if slow < WEAK or not spare < SPARE:
        return ""
    return (
        f"work takes {slow:.1f} times as long as where bounds were measured, and of its processors'"
        f" time {100.0 * spare:.0f} % was left"
    )
