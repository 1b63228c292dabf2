"""Gravity direction in one IMU's axes: its gyroscope now, its accelerometer in the long run."""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array, cross

TIME_S = 0.5
"""Time constant of the pull towards the accelerometer, and the longest gap worth bridging."""
FREE_FALL = 1.0
"""[m/s²]: a smaller specific force has no direction."""


class GravityDirection:
    """Low-passed direction of the specific force, turned with the body."""

    def __init__(self) -> None:
        """Unknown before the first sample."""
        self.up: Array | None = None
        """(3,) unit vector in the sensor's axes: the opposite of gravity."""
        self._t = -np.inf

    def add(self, t: float, omega: Array, specific_force: Array) -> None:
        """Take a sample of `t` [s]: `omega` (3,) [rad/s], `specific_force` (3,) [m/s²]."""
        dt, self._t = t - self._t, t
        norm = float(np.sqrt(specific_force @ specific_force))
        if norm < FREE_FALL:
            return
        measured = specific_force / norm
        if self.up is None or not 0.0 < dt < TIME_S:
            self.up = measured
            return
        turned = self.up - dt * cross(omega, self.up)
        mixed = turned + dt / TIME_S * (measured - turned)
        self.up = mixed / float(np.sqrt(mixed @ mixed))
