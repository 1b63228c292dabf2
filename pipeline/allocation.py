"""Wrench → thrusts of unidirectional thrusters: exact, within their limits. The paper's [26], [6].

min ‖W (A f − w)‖² + ε ‖f‖²,  f_min ≤ f ≤ f_max: where the wrench can't be had, torque errors weigh
more than force errors (losing the attitude loses everything), and of all thrusts that give it, the
least are taken.
"""

from __future__ import annotations

import numpy as np

from pipeline.box_qp import box_least_squares
from pipeline.frames import Array
from pipeline.robot import Robot

TORQUE_WEIGHT = 10.0
"""[1/m]: 0.1 N m counts as much as 1 N."""
LEAST_THRUST_WEIGHT = 1e-6
"""ε: small against any wrench error, enough to make the solution unique."""


class Allocation:
    """Box-constrained least squares by an active set, started from the last solution's."""

    def __init__(self, robot: Robot) -> None:
        """Of a robot's geometry and limits."""
        weight = np.array([1.0, 1.0, 1.0, TORQUE_WEIGHT, TORQUE_WEIGHT, TORQUE_WEIGHT])
        weighted = weight[:, None] * robot.A
        thrusters = robot.A.shape[1]
        self._robot = robot
        self._H = np.ascontiguousarray(
            weighted.T @ weighted + LEAST_THRUST_WEIGHT * np.eye(thrusters)
        )
        self._G = np.ascontiguousarray(weighted.T * weight)
        self._active = np.zeros(thrusters, dtype=np.int8)
        self.thrusts(np.zeros(6))  # compiles or loads the kernel here: never inside the loop

    def thrusts(self, wrench_in_b: Array) -> Array:
        """Thrusts (m,) [N], each in [f_min, f_max], for a wrench (6,) [N, N m]."""
        return box_least_squares(
            self._H, self._G @ wrench_in_b, self._robot.f_min, self._robot.f_max, self._active
        )
