"""What sensors do that no data sheet says: faults of a `World`, with their truth."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array

TWIN_S: Final = 2e-5
"""Between the stamps of two samples that are one."""


@dataclass(frozen=True, slots=True)
class ImuFault:
    """Of a gyroscope and the accelerometer beside it; pairs are [rad/s] and [m/s²]."""

    noise: float = 1.0
    """Of both, in units of what they should have."""
    step: tuple[float, float] = (0.0, 0.0)
    """By so much their biases change at `start`, along any axis ..."""
    tone: tuple[float, float] = (0.0, 0.0)
    """... and so large a vibration begins, its amplitude along another, ..."""
    tone_hz: float = 0.0
    start: float = 4.0
    stop: float = inf
    """... until then [s]."""
    holes: tuple[float, ...] = ()
    """When nothing is said ..."""
    hole_s: float = 0.235
    """... for so long."""
    twins: float = 0.0
    """Probability that a sample comes twice, `TWIN_S` apart and with noise of its own."""

    def added(self, rng: np.random.Generator, t: Array) -> tuple[Array, Array]:
        """What it adds at `t` (n,) [s], with no noise: (n, 3) [rad/s], (n, 3) [m/s²]."""
        errors = []
        during = ((t >= self.start) & (t < self.stop)).astype(np.float64)
        for step, tone in zip(self.step, self.tone, strict=True):
            wave = np.sin(2.0 * np.pi * (self.tone_hz * t + rng.uniform()))
            along = during[:, None] * step * _axis(rng) + (during * tone * wave)[:, None] * _axis(
                rng
            )
            errors.append(along)
        return errors[0], errors[1]

    def silent(self, t: Array) -> npt.NDArray[np.bool_]:
        """Whether samples at `t` (n,) [s] are missing."""
        missing = np.zeros(len(t), dtype=bool)
        for hole in self.holes:
            missing |= (t > hole) & (t < hole + self.hole_s)
        return missing


FINE: Final = ImuFault()


def _axis(rng: np.random.Generator) -> Array:
    axis = rng.normal(size=3)
    unit: Array = axis / np.sqrt(axis @ axis)
    return unit
