"""What an arm's joints may do in a step: rates, ranges, what is kept apart, how far it stretches.

Whatever it comes nearer to, a joint to the end of its range, a part to another one, or the arm to a
posture in which its joints can hardly move its tip along some axis (stretched out, or over its own
base; beyond it the elbow would bend the other way), it approaches by no more than a gain times what
is left of the way: so it comes to rest there without a jolt, and may leave at once. Standing still
is always allowed.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from hardware.arm.arm_model import ArmModel, jacobian_rates
from hardware.arm.mink_extra import mink
from pipeline.frames import Array

NEARS_PER_S: Final = 6.0
"""Speed of an approach per way left: at 96 °/s a joint slows down from 16° before its end on."""
MARGIN_RAD: Final = 0.02
"""Joints stay so far from the ends of their ranges: servos swing a little beyond what is told."""
RATE_SHARE: Final = 0.8
"""Of the largest rate is asked of a joint: hurried, its servo swings beyond that by up to 20 %."""
SEES_M: Final = 0.15
"""Parts that are farther from each other are not looked at: at 0.9 m/s they may come nearer."""

LEAST_M: Final = 0.015
"""Motion of the tip by a turn of its joints, along the axis along which they move it least [m/rad]:
a SO-101 gives away 7 mm of its reach for it."""
TURN_M: Final = 0.1
"""A turn of the tip counts as its way at this distance [m/rad]."""
TINY_M: Final = 1e-6
"""Where joints do not move it at all along some axis, they count as moving it by this [m/rad]."""


class Bounds(mink.Limit):
    """Those of one step, of which some may have been taken already."""

    def __init__(self, arm: ArmModel, axes: npt.NDArray[np.bool_]) -> None:
        """For one arm, led along and about `axes` (6,) of b; nothing may move yet."""
        self._arm, self._axes = arm, axes
        joints = np.eye(arm.model.nv)[arm.dofs]
        self._box = np.vstack((joints, -joints))
        self._G, self._left = self._box, np.zeros(len(self._box))

    def begin(self, configuration: mink.Configuration, jacobian: Array, h: float) -> None:
        """A step of `h` [s] from here, where the tip's Jacobian is (6, n)."""
        arm, q = self._arm, self._arm.angles(configuration.q)
        ways = np.concatenate((arm.high - q, q - arm.low)) - MARGIN_RAD
        left = [np.minimum(NEARS_PER_S * ways, RATE_SHARE * arm.parameters.rate)]
        rows = [self._box]
        for one, other in arm.pairs:
            seen = self._approach(configuration.data, one, other)
            if seen is not None:
                rows.append(seen[0])
                left.append(np.array([NEARS_PER_S * seen[1]]))
        shrinks, left_m = self._singularity(jacobian)
        rows.append(shrinks)
        left.append(np.array([NEARS_PER_S * left_m]))
        self._G, self._left = np.vstack(rows), np.maximum(0.0, h * np.concatenate(left))

    def take(self, way: Array) -> None:
        """Of this step so much (nv,) [rad] is taken."""
        self._left = np.maximum(0.0, self._left - self._G @ way)

    def compute_qp_inequalities(
        self,
        configuration: mink.Configuration,  # noqa: ARG002
        dt: float,  # noqa: ARG002
    ) -> mink.Constraint:
        """What is left. See `mink.Limit`."""
        return mink.Constraint(self._G, self._left)

    def _singularity(self, jacobian: Array) -> tuple[Array, float]:
        """How the least motion that joints make shrinks, per angle (1, nv), and by how much it may.

        [m/rad], along the axes alone that the robot is led along. Least: of the singular values
        (Σ s⁻⁴)^(−1/4), which is smooth where two of them cross.
        """
        weights = np.array([1.0, 1.0, 1.0, TURN_M, TURN_M, TURN_M])[self._axes, None]
        left, sizes, right = np.linalg.svd(weights * jacobian[self._axes], full_matrices=False)
        sizes = np.maximum(sizes, TINY_M)
        least = float((sizes**-4.0).sum() ** -0.25)
        changes = weights * jacobian_rates(jacobian)[:, self._axes]
        by_size = np.einsum("ak,jab,kb->kj", left, changes, right)
        shrinks = np.zeros((1, self._arm.model.nv))
        shrinks[0, self._arm.dofs] = -((least / sizes) ** 5.0) @ by_size
        return shrinks, least - LEAST_M

    def _approach(self, data: mujoco.MjData, one: int, other: int) -> tuple[Array, float] | None:
        """How two geoms come nearer, per angle (1, nv) [m], and by how much they may [m].

        None: they are far from each other. mink's own limit takes a way for a speed here.
        """
        model, arm, ends = self._arm.model, self._arm, np.zeros(6)
        distance = mujoco.mj_geomDistance(model, data, one, other, SEES_M, ends)
        between = ends[3:] - ends[:3]
        length = sqrt(between @ between)
        if distance >= SEES_M or length == 0.0:
            return None
        away = between / (length if distance > 0.0 else -length)
        rows = np.zeros((2, 3, model.nv))
        for row, geom, end in zip(rows, (one, other), (ends[:3], ends[3:]), strict=True):
            mujoco.mj_jac(model, data, row, None, end, int(model.geom_bodyid[geom]))
        nearer = np.zeros((1, model.nv))
        nearer[0, arm.dofs] = (away @ (rows[0] - rows[1]))[arm.dofs]
        return nearer, distance - arm.parameters.apart
