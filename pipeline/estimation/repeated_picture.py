"""A picture that comes again with a new time: noise makes no two alike, so it is no news."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.signals import BodyImu, LedRays, PhoneImu, VisionMeasurement

TURNED_RAD: Final = 1e-4
"""A tenth of a pixel, and less than the noise of a gyroscope adds up to between two pictures. Less
turning: both bodies are simulated, at rest and without noise, and so may be the pictures."""


class RepeatedPicture:
    """Remembers the last picture, and how far either side has turned since."""

    def __init__(self) -> None:
        """Nothing seen."""
        self._rays: LedRays | None = None
        self._turned = [0.0, 0.0]
        self._t = [np.inf, np.inf]

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Add up how far phone or robot turn, in whatever direction."""
        if isinstance(sample, PhoneImu):
            self._turn(0, sample.t, sample.omega_m_cf_in_c)
        else:
            self._turn(1, sample.t, sample.omega_m_bf_in_b)

    def _turn(self, side: int, t: float, omega: Array) -> None:
        dt, self._t[side] = t - self._t[side], t
        if dt > 0.0:
            self._turned[side] += dt * float(np.sqrt(omega @ omega))

    def comes_again(self, seen: VisionMeasurement) -> bool:
        """Whether `seen` says, to the last bit, what the picture before said; remembers it."""
        if self._rays is not None and _alike(self._rays, seen.rays):
            return max(self._turned) > TURNED_RAD
        self._rays, self._turned = seen.rays, [0.0, 0.0]
        return False


def _alike(a: LedRays, b: LedRays) -> bool:
    """The same places of the same LEDs, some at least."""
    same = np.array_equal(a.led, b.led) and np.array_equal(a.tangents, b.tangents)
    return same and len(a) > 0
