"""Rates of an arm's joints by where they were."""

from __future__ import annotations

from collections import deque

import numpy as np

from pipeline.frames import Array

MEAN_S = 0.01
"""Rates of joints are means over this: they themselves jump from one millisecond to the next."""


class JointRates:
    """Rates of joints by where they were, without what they do from one millisecond to the next."""

    def __init__(self) -> None:
        """At rest."""
        self._past: deque[tuple[float, Array]] = deque()

    def at(self, stamp: float, q: Array) -> tuple[Array, float]:
        """Mean rates (n,) [rad/s], and how long before `stamp` [s] they were so.

        Over `MEAN_S`, or longer if nothing was heard meanwhile.
        """
        self._past.append((stamp, q))
        while len(self._past) > 2 and stamp - self._past[0][0] > MEAN_S:
            self._past.popleft()
        then, q_then = self._past[0]
        passed = stamp - then
        return ((q - q_then) / passed, 0.5 * passed) if passed > 0.0 else (np.zeros(len(q)), 0.0)
