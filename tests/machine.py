"""How slow this machine's processor is, beside that on which real flights' bounds were measured.

A flight in real time, its browser, pictures, server and robot share two processors. Where these do
the same work in twice the time, pictures come later and the robot follows later: of the code, that
says nothing. What is measured is CPU time of work that never changes, so that neither who waits for
a processor nor what the project itself costs counts: code that became slow is not excused by this.

    python -m tests.machine    # how many tests in real time this machine runs beside each other
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

STEPS = 4_000
REFERENCE_S = 0.0077
"""Where `tick` of docs/bench/estimation.md took 68 µs and plain numpy 1122 µs."""
TRIES = 9
WEAK = 2.0
"""From here on a flight's end says nothing: all that shares two processors would need four."""


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


if __name__ == "__main__":
    print(1 if slowness() >= WEAK else 2)
