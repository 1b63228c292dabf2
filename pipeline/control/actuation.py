"""The last step of Fig. 4: a wrench that is wanted → thrusts, and what of it could not be had."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.config import TeleopConfig
from pipeline.control.allocation import Allocation
from pipeline.control.tilt import TiltToMove
from pipeline.frames import Array
from pipeline.robot import Robot

EXACT = 1e-3
"""A wrench missed by less is given [N, N m]."""


@dataclass(frozen=True, slots=True, eq=False)
class ThrustDemand:
    """What the thrusters are asked for."""

    thrusts: Array
    """(m,) [N]."""
    missing_in_b: Array
    """(6,) wanted wrench less what they give; for whoever integrates."""
    saturated: bool


class Actuation:
    """A robot's thrusters, behind the attitude loop if it must tilt to move."""

    def __init__(self, robot: Robot, config: TeleopConfig) -> None:
        """For a robot's geometry and limits."""
        self._A, self._axes = robot.A, robot.wrench_axes
        self._allocation = Allocation(robot, config.allocation)
        self._tilt = TiltToMove(robot, config.gains, config.tilt) if robot.needs_tilt else None
        self.push_in_b = np.zeros(6)
        """Given beside what is asked for, a disturbance for experiments. Sec. V-C."""

    def give(self, wrench_in_b: Array, R_fb: Array, omega_bf_in_b: Array) -> ThrustDemand:
        """Thrusts for a wrench (6,) at the attitude and angular rate of the body."""
        if self._tilt is None:
            pushed_in_b = wrench_in_b + self.push_in_b
            thrusts = self._allocation.thrusts(pushed_in_b)
            missing_in_b = (pushed_in_b - self._A @ thrusts) * self._axes
            return ThrustDemand(thrusts, missing_in_b, _is_short(missing_in_b))
        tilting = self._tilt.wrench(wrench_in_b, R_fb, omega_bf_in_b) + self.push_in_b
        thrusts = self._allocation.thrusts(tilting)
        missing_in_b = (tilting - self._A @ thrusts) * self._axes
        saturated = _is_short(missing_in_b) or _is_short(self._tilt.refused_in_b)
        # sideways it has what the limit of the tilt left, once the body has turned there
        missing_in_b[:3] += self._tilt.refused_in_b
        missing_in_b[3:5] = 0.0
        return ThrustDemand(thrusts, missing_in_b, saturated)


def _is_short(missing_in_b: Array) -> bool:
    return bool(np.abs(missing_in_b).max() > EXACT)
