"""A robot that is told a twist and does not move so: at the end of its reach, or before a wall.

What it was told, after its own lag and delay, is held against how it says that it moves. Both are
averaged: a lag that is a little another one makes much of a quick hand, but nothing of it lasts.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.control import low_pass
from pipeline.frames import Array
from pipeline.robot import TwistDrive

AVERAGED_S: Final = 0.3
"""Hands shake it by more than 2 Hz ..."""
LEAST: Final = np.array([0.02, 0.15])
"""... and what is left of that, of noise and of slip is below this [m/s, rad/s]."""
SHARE: Final = 0.4
"""Of the twist told is missing, at least, where something holds it back."""


class HeldBack:
    """Of one robot, told once a period."""

    def __init__(self, drive: TwistDrive, axes: npt.NDArray[np.bool_]) -> None:
        """Free, and at rest."""
        self._late_s, self._axes = drive.lag_s + drive.delay_s, axes
        self.start()

    def start(self) -> None:
        """Begin anew: nothing is known to hold it."""
        self._expected = self._mean_expected = self._mean_missing = np.zeros(6)

    def watch(self, told_in_b: Array, moves_in_b: Array | None, h: float) -> None:
        """For `h` [s] it was told a twist (6,), and it moves so; None: it does not say."""
        if moves_in_b is None:
            self.start()
            return
        follows, averages = low_pass.share(h / self._late_s), low_pass.share(h / AVERAGED_S)
        self._expected = self._expected + follows * (told_in_b - self._expected)
        missing = np.where(self._axes, self._expected - moves_in_b, 0.0)
        self._mean_expected = self._mean_expected + averages * (
            self._expected - self._mean_expected
        )
        self._mean_missing = self._mean_missing + averages * (missing - self._mean_missing)

    @property
    def taken(self) -> float:
        """More than 1: something holds it back."""
        missing = np.linalg.norm(self._mean_missing.reshape(2, 3), axis=1)
        expected = np.linalg.norm(self._mean_expected.reshape(2, 3), axis=1)
        return float((missing / np.maximum(LEAST, SHARE * expected)).max())
