"""What a flying robot's own flight controller does while its thrust falls: it does not turn over.

A robot that hangs or stands needs none. On the link only thrusts travel, so that when it is silent
nobody else can keep the attitude; every real robot that flies has such a loop on board.
"""

from __future__ import annotations

import numpy as np

from pipeline.config import HoldConfig
from pipeline.frames import Array
from pipeline.robot import Robot


class Leveller:
    """Keeps the attitude it began with, by the gyroscope."""

    def __init__(self, robot: Robot, config: HoldConfig) -> None:
        """For a robot that can be lifted and turned."""
        lift_and_torque = np.linalg.pinv(robot.A[2:])
        self._lift, self._torque = lift_and_torque[:, 0], lift_and_torque[:, 1:]
        self._Kp, self._Kd = config.stiffness * robot.inertia, config.damping * robot.inertia
        self._A_z, self._f_max = robot.A[2], robot.f_max
        self._turned = np.zeros(3)

    def start(self) -> None:
        """Take the present attitude as the one to keep."""
        self._turned = np.zeros(3)

    def thrusts(self, falling: Array, omega_bf_in_b: Array, h: float) -> Array:
        """(m,) [N] with the lift of `falling` and a torque against turning, `h` [s] later."""
        self._turned = self._turned + h * omega_bf_in_b
        torque_in_b = -self._Kp * self._turned - self._Kd * omega_bf_in_b
        wanted = self._lift * float(self._A_z @ falling) + self._torque @ torque_in_b
        return np.clip(wanted, 0.0, self._f_max)
