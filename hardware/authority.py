"""What a robot's thrusters can do about each axis, and how far from rest they can hold it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from pipeline.control.dynamics import Dynamics
from pipeline.frames import Array
from pipeline.robot import Robot

LEAST_STIFFNESS = 1e-6
"""[N/m]; below, nothing pulls it back and its reach has no end."""


@dataclass(frozen=True, slots=True, eq=False)
class Authority:
    """About one axis of b, none of the others being used."""

    down: float
    """Most against the axis, beside what carries the robot [N, N m]; positive."""
    up: float
    """Most along it."""
    reach: float
    """How far the weaker of both holds it against the suspension [m, rad]; inf without one."""


def authority(robot: Robot, dynamics: Dynamics) -> dict[int, Authority]:
    """By axis (0 to 5), of those that thrusters drive directly."""
    found: dict[int, Authority] = {}
    for axis in np.flatnonzero(robot.wrench_axes).tolist():
        down, up = _most(robot, axis, -1.0), _most(robot, axis, 1.0)
        stiffness = float(dynamics.stiffness[axis])
        reach = min(down, up) / stiffness if stiffness > LEAST_STIFFNESS else float("inf")
        found[axis] = Authority(down, up, reach)
    return found


def _most(robot: Robot, axis: int, sign: float) -> float:
    """Most of an axis that thrusts within their limits give beside the weight."""
    rows = np.flatnonzero(robot.wrench_axes)
    A: Array = robot.A[rows]
    carried = np.array([0.0, 0.0, robot.weight_to_carry, 0.0, 0.0, 0.0])[rows]
    along = (rows == axis).astype(float)
    # unknowns: thrusts and how much; A f = carried + sign * much * along
    equal = np.hstack((A, -sign * along[:, None]))
    bounds = [(0.0, robot.f_max)] * A.shape[1] + [(0.0, None)]
    cost = np.zeros(A.shape[1] + 1)
    cost[-1] = -1.0
    found = linprog(cost, A_eq=equal, b_eq=carried, bounds=bounds)
    return float(found.x[-1]) if found.success else 0.0
