"""A picture that comes again with a new time: noise makes no two alike, so it is no news."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.uneven_turning import UnevenTurning
from pipeline.signals import BodyImu, LedRays, PhoneImu, VisionMeasurement


class RepeatedPicture:
    """Remembers the last picture, and whether anything turned meanwhile."""

    def __init__(self) -> None:
        """Nothing seen."""
        self._rays: LedRays | None = None
        self._turning = UnevenTurning()

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Take a sample of phone or robot."""
        self._turning.add_imu(sample)

    def comes_again(self, seen: VisionMeasurement) -> bool:
        """Whether `seen` says to the last bit what was said before, though something turns.

        Where nothing does it is news: an encoder has nothing to draw anew.
        """
        if self._rays is not None and _alike(self._rays, seen.rays):
            return self._turning.is_detected
        self._rays = seen.rays
        self._turning.begin()
        return False


def _alike(a: LedRays, b: LedRays) -> bool:
    """The same places of the same LEDs, some at least."""
    same = np.array_equal(a.led, b.led) and np.array_equal(a.tangents, b.tangents)
    return same and len(a) > 0
