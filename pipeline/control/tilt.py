"""Robots whose thrusters all push along one axis of b go sideways by leaning: a quadrotor.

The force that is wanted says where the thrust's axis must point; roll and pitch torques turn the
body there (Lee, Leok, McClamroch 2010, without their feed-forward terms).
"""

from __future__ import annotations

from math import atan2, sqrt, tan

import numpy as np

from pipeline.config import TiltConfig
from pipeline.frames import Array, exp
from pipeline.gains import Gains
from pipeline.robot import Robot

LEAST_LIFT = 0.2
"""Of the weight: less thrust can't turn the body, and its direction would mean nothing."""


class TiltToMove:
    """Any force that is wanted → one that thrusters along b's z axis can give, once turned."""

    def __init__(self, robot: Robot, gains: Gains, config: TiltConfig) -> None:
        """Roll and pitch rows of `gains` are those of the attitude, if nobody else keeps it."""
        self._least = max(LEAST_LIFT * robot.weight_to_carry, robot.f_min)
        drive = robot.attitude
        own = config.max_tilt_rad if drive is None else drive.max_tilt
        self._slope = tan(min(config.max_tilt_rad, own))
        self._Kp, self._Kd = gains.Kp[3:5], gains.Kd[3:5]
        self.refused_in_b = np.zeros(3)
        """Force that the limit of the tilt cut off, at the last force (3,) [N]."""

    def force_in_b(self, wanted_in_b: Array, R_fb: Array) -> Array:
        """The force (3,) [N] along which the body's z axis is to point: no farther than allowed."""
        force_in_b: Array = R_fb.T @ self._within_limit(R_fb @ wanted_in_b)
        self.refused_in_b = wanted_in_b - force_in_b
        return force_in_b

    def torque_in_b(self, force_in_b: Array, turned_in_b: Array, omega_in_b: Array) -> Array:
        """(2,) about x and y [N m], by which the body turns its z axis there.

        It will have turned (3,) [rad] when the torque acts, and will turn at `omega_in_b` (3,).
        """
        left = _turn_of_z_to(exp(turned_in_b).T @ force_in_b)
        return self._Kp * left - self._Kd * omega_in_b[:2]

    def _within_limit(self, force_in_f: Array) -> Array:
        lift = max(float(force_in_f[2]), self._least)
        sideways = sqrt(float(force_in_f[0] ** 2 + force_in_f[1] ** 2))
        share = min(1.0, self._slope * lift / sideways) if sideways > 0.0 else 1.0
        return np.array([share * force_in_f[0], share * force_in_f[1], lift])


def _turn_of_z_to(direction: Array) -> Array:
    """(2,) rotation about x and y that brings the z axis to `direction` (3,), π at most [rad]."""
    x, y, z = (float(v) for v in direction)
    across = sqrt(x * x + y * y)
    if across < 1e-12:
        return np.zeros(2)
    return atan2(across, z) / across * np.array([-y, x])
