"""The phone's own attitude from raw gyroscope and accelerometer, without a magnetometer.

The yaw of f is free (nothing in the method needs north) and drifts with the gyroscope's bias,
which costs the virtual camera millimetres; the browser's fused orientation jumps when its
magnetometer does, comes in steps of 0.1°, and would cost centimetres: it is not used at all.
"""

from __future__ import annotations

import numpy as np

from pipeline.frames import GRAVITY, Array, R_fc_level_from_specific_force, cross, exp
from pipeline.signals import PhoneImu

GAIN = 0.15
"""Pull towards the accelerometer's vertical [1/s]: slow, for hands accelerate all ways. At first
it is faster: one over the time since the start, the mean of all that was felt."""
BIAS_GAIN = 0.01
"""[1/s²]."""
MAX_GAP_S = 0.2
"""Longer without samples: what was integrated is worth nothing, start anew."""


class Attitude:
    """Complementary filter on SO(3) (after Mahony, Hamel, Pflimlin 2008, the paper's [20])."""

    def __init__(self) -> None:
        """Unknown until the first sample."""
        self._R_fc: Array | None = None
        self._bias = np.zeros(3)
        self._omega = np.zeros(3)
        self._t = self._t_start = -np.inf
        self._turn: Array = np.eye(3)
        self.resets = 0

    @property
    def R_fc(self) -> Array | None:
        """Attitude at the last sample, (3, 3), or None before the first."""
        return self._R_fc

    @property
    def bias_omega(self) -> Array:
        """Gyroscope bias (3,) [rad/s]."""
        return self._bias

    @property
    def up_in_c(self) -> Array | None:
        """Opposite of gravity in camera axes, or None before the first sample."""
        return None if self._R_fc is None else self._R_fc[2]

    def take_turn(self) -> Array:
        """How the axes of f were turned since the last call, (3, 3), to put its vertical right.

        R_fc has turned with them, though the camera has not: no motion, but better knowledge.
        """
        turn, self._turn = self._turn, np.eye(3)
        return turn

    def add(self, imu: PhoneImu) -> None:
        """Take a sample; samples not newer than the last are ignored."""
        dt = imu.t - self._t
        if dt <= 0.0:
            return
        omega, self._omega = 0.5 * (self._omega + imu.omega_m_cf_in_c), imu.omega_m_cf_in_c
        self._t = imu.t
        force = imu.a_m_cf_in_c
        norm = float(np.sqrt(force @ force))
        if self._R_fc is None or dt > MAX_GAP_S:
            if norm > 0.5 * GRAVITY:
                self._begin(imu.t, force)
            return
        R_fc = self._R_fc @ exp((omega - self._bias) * dt)
        if 0.7 * GRAVITY < norm < 1.3 * GRAVITY:
            tilt = cross(force / norm, R_fc[2])
            gain = max(GAIN, 1.0 / (imu.t - self._t_start + dt))
            turn = exp(min(1.0, gain * dt) * (R_fc @ tilt))
            R_fc, self._turn = turn @ R_fc, turn @ self._turn
            self._bias = self._bias - BIAS_GAIN * dt * tilt
        self._R_fc = R_fc

    def _begin(self, t: float, force_in_c: Array) -> None:
        """Level, by one sample; the yaw of an earlier attitude is kept."""
        R_fc = np.eye(3) if self._R_fc is None else self._R_fc
        self.resets += self._R_fc is not None
        self._R_fc = R_fc_level_from_specific_force(R_fc @ force_in_c) @ R_fc
        self._t_start = t
