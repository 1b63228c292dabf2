"""How far a motion sensor's samples scatter, by nothing but themselves.

A variogram tells the parts of a signal from each other (Cressie, Statistics for Spatial Data,
1993). White noise is alike at every lag; a motion that wanders adds in proportion to the lag, a
smooth one more, so that noise is what is left at lag nought, the nugget; a vibration is absent at
one lag or another, so noise is no more than the least of them.
"""

from __future__ import annotations

import numpy as np

from pipeline.estimation.sample_noise_kernels import LAGS, RING, hear
from pipeline.frames import Array


class SampleNoise:
    """Of one device's gyroscope and accelerometer."""

    def __init__(self, sigmas: Array) -> None:
        """Nothing heard; standard deviations (2,) of a sample are expected to be such."""
        self._usual = np.square(sigmas)
        self._times, self._ring = np.zeros(RING), np.zeros((RING, 6))
        self._count, self._squares = 0, np.zeros((2, LAGS))
        self.levels = np.zeros((2, 2))
        """By sensor: noise of a sample [unit], roughness of the motion between [unit/s/√Hz]."""

    def add(self, t: float, rate: Array, force: Array) -> None:
        """Take a sample of `t` [s]; one that comes after a later one tells nothing."""
        self._count = hear(
            t,
            rate,
            force,
            self._times,
            self._ring,
            self._count,
            self._usual,
            self._squares,
            self.levels,
        )
