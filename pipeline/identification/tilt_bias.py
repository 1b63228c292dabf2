"""Tilt bias: how far the robot's own vertical is off the images', by its accelerometer's bias."""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array, cross, exp

SLOWEST = 0.02
"""Share of a new picture, once many were seen."""


class TiltBias:
    """Learnt from believed poses; true until the robot is another one."""

    def __init__(self) -> None:
        """Begin without a bias."""
        self._off = np.zeros(3)
        """Turn of the measured vertical onto the true one [rad], in b."""
        self._pictures = 0

    def learn(self, up_in_c: Array | None, up_in_b: Array | None, R_cb: Array) -> None:
        """Learn from a believed attitude."""
        if up_in_c is None or up_in_b is None:
            return
        self._pictures += 1
        share = max(1.0 / self._pictures, SLOWEST)
        self._off = self._off + share * (cross(up_in_b, R_cb.T @ up_in_c) - self._off)

    def corrected(self, up_in_b: Array | None) -> Array | None:
        """A measured vertical without what is known to be wrong with it."""
        return None if up_in_b is None else exp(self._off) @ up_in_b
