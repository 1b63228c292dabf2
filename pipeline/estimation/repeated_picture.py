"""A picture that comes again with a new time: noise makes no two alike, so it is no news."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.signals import BodyImu, LedRays, PhoneImu, VisionMeasurement

MOVED_RAD_S: Final = 0.03
"""By how much a rate changes in a hand or in flight, and by no gyroscope's noise or bias. Where no
rate does, a picture that says the same is news: an encoder has nothing to draw anew."""


class RepeatedPicture:
    """Remembers the last picture, and how the rates of either side have changed since."""

    def __init__(self) -> None:
        """Nothing seen."""
        self._rays: LedRays | None = None
        self._rates: dict[type, tuple[Array, Array]] = {}

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Widen the bounds of the rates of phone or robot."""
        omega = sample.omega_m_cf_in_c if isinstance(sample, PhoneImu) else sample.omega_m_bf_in_b
        low, high = self._rates.get(type(sample), (omega, omega))
        self._rates[type(sample)] = np.minimum(low, omega), np.maximum(high, omega)

    @property
    def _moved(self) -> bool:
        return any(float((high - low).max()) > MOVED_RAD_S for low, high in self._rates.values())

    def comes_again(self, seen: VisionMeasurement) -> bool:
        """Whether `seen` says to the last bit what was said before anything moved; remembers it."""
        if self._rays is not None and _alike(self._rays, seen.rays):
            return self._moved
        self._rays = seen.rays
        self._rates.clear()
        return False


def _alike(a: LedRays, b: LedRays) -> bool:
    """The same places of the same LEDs, some at least."""
    same = np.array_equal(a.led, b.led) and np.array_equal(a.tangents, b.tangents)
    return same and len(a) > 0
