"""How slow this machine's processor is, beside that on which real flights' bounds were measured.

A flight in real time, its browser, pictures, server and robot share two processors, which suffice
for less where the same work takes longer. CPU time is measured, of work that never changes: who
waits for a processor does not count, nor what the project itself costs. No bound follows from it.
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

STEPS = 4_000
REFERENCE_S = 0.0077
"""Inferred, not measured there: it took 15-25 ms where the plain numpy of `bench_relative` took
2.7-3.3 ms of CPU, and that took 1.122 ms where docs/bench/estimation.md was made."""
TRIES = 9


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
