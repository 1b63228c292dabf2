"""The phone's own attitude from raw gyroscope and accelerometer, without a magnetometer.

The yaw of f is free (nothing in the method needs north) and drifts with the gyroscope's bias,
which costs the virtual camera millimetres; the browser's fused orientation jumps when its
magnetometer does, comes in steps of 0.1°, and would cost centimetres: it is not used at all.
"""

from __future__ import annotations

from math import inf, radians, sqrt, tanh

import numpy as np

from pipeline.frames import GRAVITY, Array, R_fc_level_from_specific_force, cross, exp
from pipeline.imu_stream import MAX_GAP_S
from pipeline.signals import PhoneImu

GAIN = 0.15
"""Pull towards the accelerometer's vertical [1/s]: slow, for hands accelerate all ways. At first
it is faster: one over the time since the start, the mean of all that was measured."""
BIAS_GAIN = 0.01
"""[1/s²]."""
HAND_VARIANCE = 0.005
"""Density of the tilt that a hand's acceleration adds to gravity [rad² s]: 1.5 m/s² for 0.2 s. A
gain g [1/s] is that of a Kalman filter whose tilt has the variance g `HAND_VARIANCE`."""
MISSED, MISSED_S = radians(15.0), 0.5
"""The accelerometer's vertical so far beside, averaged over so long [s], is no hand's acceleration:
the gyroscope missed a turn. By `GAIN` alone a tilt of 33° would stay for half a minute."""
SAMPLE_S = 0.02
"""What one sample of the accelerometer counts for after a gap."""
LOST_S = 3.0
"""Longer without samples: what was integrated is worth nothing, start anew. Over a gap shorter than
that, what the gyroscope would have measured is inferred from both ends."""
HAND_RATE, HAND_RATE_S = 0.5, 0.2
"""A hand's angular rate, one axis [rad/s], and its correlation time."""


class Attitude:
    """Complementary filter on SO(3) (after Mahony, Hamel, Pflimlin 2008, the paper's [20])."""

    def __init__(self) -> None:
        """Unknown until the first sample."""
        self._R_fc: Array | None = None
        self._bias = np.zeros(3)
        self._omega = np.zeros(3)
        self._t = self._t_start = -np.inf
        self._is_lost = False
        self._turn: Array = np.eye(3)
        self._off_in_f = np.zeros(3)
        """By how much the accelerometer's vertical is beside, on average; sine of the angle."""
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

    @property
    def t(self) -> float:
        """Time of the last sample [s]; -inf before the first."""
        return self._t

    @property
    def sigma(self) -> float:
        """Standard deviation of its tilt at the last sample [rad]; inf before the first."""
        if self._R_fc is None:
            return inf
        age = self._t - self._t_start
        return sqrt(HAND_VARIANCE * max(GAIN, 1.0 / max(age, SAMPLE_S)))

    def reset(self) -> None:
        """Begin again with another phone; the yaw of the one before is kept."""
        self._is_lost, self._bias = True, np.zeros(3)

    def correct(self, R_fc: Array, sigma: float) -> None:
        """Correct by an attitude (3, 3) at the last sample, otherwise known to `sigma` [rad].

        No turn of f (`take_turn`): it is the camera's motion in a gap that was not known.
        """
        self._R_fc, self._turn = R_fc, np.eye(3)
        self._set_variance(sigma * sigma)

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
        self._is_lost = self._is_lost or dt > LOST_S
        if self._R_fc is None or self._is_lost:
            if norm > 0.5 * GRAVITY:
                self._begin(imu.t, force)
            return
        turn = (omega - self._bias) * dt
        if dt > MAX_GAP_S:
            turn = turn * self._bridge(dt)
        R_fc = self._R_fc @ exp(turn)
        if 0.7 * GRAVITY < norm < 1.3 * GRAVITY:
            h = dt if dt <= MAX_GAP_S else SAMPLE_S
            tilt = cross(force / norm, R_fc[2])
            self._watch(R_fc @ tilt, h)
            gain = max(GAIN, 1.0 / (imu.t - self._t_start + h))
            turn = exp(min(1.0, gain * h) * (R_fc @ tilt))
            R_fc, self._turn = turn @ R_fc, turn @ self._turn
            self._bias = self._bias - BIAS_GAIN * h * tilt
        self._R_fc = R_fc

    def _watch(self, off_in_f: Array, h: float) -> None:
        """Doubt the tilt if the accelerometer has denied it for long enough."""
        self._off_in_f = self._off_in_f + min(1.0, h / MISSED_S) * (off_in_f - self._off_in_f)
        off2 = float(self._off_in_f @ self._off_in_f)
        if off2 > max(MISSED, self.sigma) ** 2:
            self._set_variance(off2)
            self._off_in_f = np.zeros(3)

    def _bridge(self, dt: float) -> float:
        """Grow the variance by a gap of `dt` [s]; gives how far the mean rate of its ends counts.

        Mean and variance of the turn between two known rates, for rates that are an
        Ornstein-Uhlenbeck process.
        """
        known_s = 2.0 * HAND_RATE_S * tanh(0.5 * dt / HAND_RATE_S)
        self._set_variance(self.sigma**2 + 2.0 * HAND_RATE**2 * HAND_RATE_S * (dt - known_s))
        return known_s / dt

    def _set_variance(self, variance: float) -> None:
        """The gain falls as one over the time since the start: so long ago it would have begun."""
        self._t_start = self._t - HAND_VARIANCE / variance

    def _begin(self, t: float, force_in_c: Array) -> None:
        """Level, by one sample; the yaw of an earlier attitude is kept."""
        R_fc = np.eye(3) if self._R_fc is None else self._R_fc
        self.resets += self._R_fc is not None
        self._R_fc = R_fc_level_from_specific_force(R_fc @ force_in_c) @ R_fc
        self._t_start, self._is_lost = t, False
        self._off_in_f = np.zeros(3)
