"""A robot that is told attitude and thrust: its own loops turn the body, its own mixer the motors.

Autopilots take roll, pitch, a yaw rate and a thrust (MAVLink's SET_ATTITUDE_TARGET, Betaflight's
ANGLE mode, Crazyflie's commander). Roll and pitch turn b's z axis along the force that is wanted,
in h, which is f turned about its z axis until x is below the body's x (REP-103: R_hb = R_y(pitch)
R_x(roll); a positive pitch is nose down). The yaw rate is that by which a robot that follows rates
with the time constant T turns as the torque that is wanted would turn it, from J ω̇ = τ and
T ω̇ = ω_told − ω:

    ω_told = ω + T τ / J

A lean is followed with two equal lags of T/2: of one of them the set-point is ahead (`SMOOTH_S`
keeps out the noise of the derivative).

Its vertical is not ours: half a degree between them pushes a robot of 1.2 kg aside by 0.1 N. So
what it leans, by our estimate, beyond what it was told and should lean by now (`LeanModel`), is
taken off what it is told.
"""

from __future__ import annotations

from collections import deque
from math import atan2, hypot, radians
from typing import Final

import numpy as np

from pipeline.config import PERIOD_S
from pipeline.control import low_pass
from pipeline.frames import Array, rotation_about_z, rpy_from_R
from pipeline.robot import AttitudeDrive, Robot

TRIM_S: Final = 1.0
"""In which the difference of the two verticals is learnt anew: longer than a lean lasts, whose lag
is not quite as told ..."""
FIRST_S: Final = 0.1
"""... but what little is known of it in the first moments in the air counts in full."""
MOST_TRIM: Final = radians(3.0)
"""[rad]; more is a robot that is held, or no vertical."""
SMOOTH_S: Final = 0.02
"""Time constant of the lead by which one of two lags is made up for."""
MOST_RATE: Final = 2.5
"""At which it is told to lean [rad/s]: from one border to the other at once would spin the robot
faster than a flight allows (`EnvelopeConfig.max_body_rate`)."""
FLIES: Final = 0.85
"""Share of its weight in thrust: with less it may stand on the floor, and can't lean ..."""
LIFTS_S: Final = 0.5
"""... and for so long, until it has lifted and leans as it is told."""


class LeanModel:
    """How a robot leans by what it was told: after a delay, with two equal lags."""

    def __init__(self, drive: AttitudeDrive) -> None:
        """Level for long."""
        self._lag_s = 0.5 * drive.lag_s
        self._on_their_way = deque([np.zeros(2)] * max(1, round(drive.delay_s / PERIOD_S)))
        self._halfway = np.zeros(2)
        self.lean = np.zeros(2)
        """Roll and pitch now (2,) [rad]."""

    def follow(self, told: Array, h: float) -> None:
        """Go on by `h` [s], at the end of which it is told to lean so (2,) [rad]."""
        share = low_pass.share(h / self._lag_s)
        self.lean = self.lean + share * (self._halfway - self.lean)
        self._halfway = self._halfway + share * (self._on_their_way.popleft() - self._halfway)
        self._on_their_way.append(told)


class AttitudeSetPoint:
    """A force and a yaw torque → what such a robot is told. Call once a period."""

    def __init__(self, drive: AttitudeDrive, robot: Robot) -> None:
        """For its limits, level."""
        self._drive, self._least = drive, FLIES * robot.weight_to_carry
        self._rate_per_torque = drive.yaw_lag_s / float(robot.inertia[2])
        self._model, self._trim = LeanModel(drive), np.zeros(2)
        self._smooth: Array | None = None
        self._thrust = self._flown_s = 0.0

    def of(
        self, force_in_f: Array, given_in_b: Array, R_fb: Array, omega_in_b: Array, h: float
    ) -> Array:
        """Roll, pitch [rad], yaw rate [rad/s] and thrust [N] (4,), `h` [s] after the last.

        Args:
            force_in_f: Where the body's z axis is to point (3,) [N].
            given_in_b: Thrust along it as it is now, and yaw torque: of a wrench (6,) [N, N m].
            R_fb: The body's attitude.
            omega_in_b: Its angular rate (3,) [rad/s].
            h: The seconds.
        """
        _, _, yaw = rpy_from_R(R_fb)
        x, y, z = (float(v) for v in rotation_about_z(-float(yaw)) @ force_in_f)
        lean = self._ahead(np.array([atan2(-y, hypot(x, z)), atan2(x, z)]), h) - self._trim
        yaw_rate = float(omega_in_b[2] + self._rate_per_torque * given_in_b[5])
        told = self._drive.within(float(lean[0]), float(lean[1]), yaw_rate)
        # an autopilot turns as fast as the lean is far; straight there leaves no circle of leans
        left, most = told[:2] - self._model.lean, MOST_RATE * self._drive.lag_s
        told[:2] = self._model.lean + most / max(hypot(*left.tolist()), most) * left
        self._model.follow(told[:2], h)
        self._thrust = float(given_in_b[2])
        return np.append(told, self._thrust)

    def learn(self, R_fb: Array, h: float) -> None:
        """How its vertical differs from ours, while the body's attitude is known: not in a gap."""
        self._flown_s = self._flown_s + h if self._thrust >= self._least else 0.0
        if self._flown_s < LIFTS_S:
            return
        leans = rpy_from_R(R_fb)[:2]
        beyond = leans - self._model.lean - self._trim
        share = low_pass.share(h / min(TRIM_S, max(FIRST_S, self._flown_s - LIFTS_S)))
        trim = self._trim + share * beyond
        self._trim = np.clip(trim, -MOST_TRIM, MOST_TRIM)

    def _ahead(self, lean: Array, h: float) -> Array:
        """Where to lean (2,) [rad] by when the first of the two lags is over."""
        before = lean if self._smooth is None else self._smooth
        self._smooth = before + low_pass.share(h / SMOOTH_S) * (lean - before)
        lead = 0.5 * self._drive.lag_s / SMOOTH_S - 1.0
        ahead: Array = lean + lead * (lean - self._smooth)
        return ahead
