"""Wrench → thrusts of unidirectional thrusters, within their limits. The paper's [26], [6].

Where a wrench can be had, `torque_first` and `scale` give it with the least thrusts (min ‖f‖²).
Where it can't:

    torque_first  min ‖W (A f − w)‖² + ε ‖f‖²: torque errors weigh more than force errors, because
                  losing the attitude loses everything
    scale         the largest share of the wrench that can be had, its direction kept exactly
    lift          the least thrusts above the lower limit, each cut at the upper one: [26] knows
                  only the former; what the paper does, as far as it tells
    clip          pseudo-inverse, each thrust cut at its limits: what others do, for comparison
"""

from __future__ import annotations

import numpy as np

from pipeline.config import AllocationConfig
from pipeline.control.box_qp import box_least_squares
from pipeline.control.wrench_set import WrenchSet
from pipeline.frames import Array
from pipeline.robot import Robot

LEAST_THRUST_WEIGHT = 1e-6
"""ε: small against any wrench error, enough to make the solution unique."""
DEFAULT = AllocationConfig()
INSIDE = 1.0 - 1e-9
"""A wrench on the border is asked for a hair inside: the last digit must not decide."""

BOUNDLESS = 1e3
"""Times the upper limit: above any thrust."""
EXACT = 1e-8
"""Of `scale` [N, N m]; reached after one correction, unless thrusters are nearly parallel."""
MOST_CORRECTIONS = 20
"""At most: each leaves a share of the order of ε."""


class Allocation:
    """Box-constrained least squares by an active set, started from the last solution's."""

    def __init__(self, robot: Robot, config: AllocationConfig = DEFAULT) -> None:
        """Of a robot's geometry and limits; wrench axes that are let alone weigh nothing.

        Raises:
            ValueError: the policy is `scale`, and the thrusters can't drive every wrench axis.
        """
        axes = np.asarray(robot.wrench_axes)
        weight = np.where(axes, np.repeat((1.0, config.torque_weight), 3), 0.0)
        weighted = weight[:, None] * robot.A
        thrusters = robot.A.shape[1]
        self._robot, self._axes = robot, axes
        self._H = np.ascontiguousarray(
            weighted.T @ weighted + LEAST_THRUST_WEIGHT * np.eye(thrusters)
        )
        self._G = np.ascontiguousarray(weighted.T * weight)
        self._active = np.zeros(thrusters, dtype=np.int8)
        self._least = {
            "torque_first": self._nearest,
            "scale": self._scaled,
            "lift": self._lifted,
            "clip": self._clipped,
        }[config.policy]
        if config.policy == "scale":
            self._set = WrenchSet(robot.A[axes], robot.f_min, robot.f_max)
        self._inverse = np.linalg.pinv(weighted) * weight
        self.thrusts(np.zeros(6))  # compiles or loads the kernel here: never inside the loop

    def thrusts(self, wrench_in_b: Array) -> Array:
        """Thrusts (m,) [N], each in [f_min, f_max], for a wrench (6,) [N, N m]."""
        return self._least(wrench_in_b)

    def _nearest(self, wrench_in_b: Array) -> Array:
        low, high = self._robot.f_min, self._robot.f_max
        return box_least_squares(self._H, self._G @ wrench_in_b, low, high, self._active)

    def _scaled(self, wrench_in_b: Array) -> Array:
        """Of a wrench of which no share at all can be had, the nearest."""
        least, largest = self._set.shares(wrench_in_b[self._axes])
        share = min(1.0, INSIDE * largest)
        if share < max(0.0, least):
            return self._nearest(wrench_in_b)
        wanted = share * wrench_in_b
        asked, thrusts = wanted, self._nearest(wanted)
        for _ in range(MOST_CORRECTIONS):  # ε gives a little less: so much more is asked for
            short = (wanted - self._robot.A @ thrusts) * self._axes
            if float(short @ short) < EXACT**2:
                break
            asked = asked + short
            thrusts = self._nearest(asked)
        return thrusts

    def _lifted(self, wrench_in_b: Array) -> Array:
        low, high = self._robot.f_min, self._robot.f_max
        thrusts = box_least_squares(
            self._H, self._G @ wrench_in_b, low, BOUNDLESS * high, self._active
        )
        return np.minimum(thrusts, high)

    def _clipped(self, wrench_in_b: Array) -> Array:
        return np.clip(self._inverse @ wrench_in_b, self._robot.f_min, self._robot.f_max)
