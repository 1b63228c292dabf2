"""Full scale: the most that a sensor ever says, and says again when there is more."""

from __future__ import annotations

from math import inf
from typing import Final

from pipeline.frames import Array

LOUD: Final = (4.0, 14.0)
"""No gyroscope [rad/s] and no accelerometer [m/s²] ends below."""


class FullScale:
    """Learns where one sensor's samples are cut off, from two in a row that are alike."""

    def __init__(self, loud: float) -> None:
        """Begin without a limit; it is above `loud`."""
        self._most, self._last = loud, 0.0
        self.limit = inf
        """An axis that says so much says nothing."""

    def hear(self, sample: Array) -> bool:
        """Take a sample (3,); tells whether it is cut off."""
        size = max(map(abs, sample.tolist()))
        if size > self._most:
            self._most, self.limit = size, inf
        elif size == self._most == self._last:
            self.limit = size
        self._last = size
        return bool(size >= self.limit)
