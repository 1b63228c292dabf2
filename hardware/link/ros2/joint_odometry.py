"""How the tip of an arm moves, and where it is, by the states of its joints as ROS 2 has them."""

from __future__ import annotations

from collections.abc import Hashable
from math import pi

import numpy as np

from hardware.arm.arm_model import ArmModel
from hardware.link.base_end import HeardJoints, HeardOdometry
from hardware.pose_setpoint import BasePose
from pipeline.frames import Array

SHORTEST_US, LONGEST_US = 500, 250_000
"""Between two messages by whose angles rates are told, for want of rates [µs]."""

MOST_RAD = 4.0 * pi
"""No joint with a range tells more."""


class JointOdometry:
    """Of one arm, by the model that its robot file names."""

    def __init__(self, arm: ArmModel, frame: str) -> None:
        """`frame` is what ROS calls the model's base axes k."""
        self._arm, self._frame = arm, frame
        self._before: tuple[Hashable, int, Array] | None = None

    def heard(self, joints: HeardJoints) -> HeardOdometry | None:
        """What it says of the tip.

        None: of other joints, as grippers and tables publish theirs on the same topic, or the first
        of one who tells no rates.
        """
        order = [_index(joints.names, name) for name in self._arm.names]
        if -1 in order or len(joints.positions) != len(joints.names):
            return None
        q = np.array([joints.positions[k] for k in order])
        stamp_us, rates = joints.stamp_us, _joint_velocities(joints, order)
        if rates is None:
            before, self._before = self._before, (joints.writer, stamp_us, q)
            if before is None or before[0] != joints.writer:
                return None
            passed_us = stamp_us - before[1]
            if not SHORTEST_US <= passed_us <= LONGEST_US:
                return None
            rates = (q - before[2]) / (1e-6 * passed_us)
            stamp_us -= passed_us // 2  # they are of the time between
        if not (np.abs(q) < MOST_RAD).all():  # nor is NaN; MuJoCo is to see none of these
            q, rates = np.zeros(len(q)), np.full(len(q), np.nan)
        v_x, v_y, v_z, w_x, w_y, w_z = (self._arm.jacobian(q) @ rates).tolist()
        pose = BasePose(*self._arm.tip(q), self._frame)
        twist_in_b = (v_x, v_y, v_z, w_x, w_y, w_z)
        return HeardOdometry(joints.writer, twist_in_b, stamp_us, pose=pose)


def _joint_velocities(joints: HeardJoints, order: list[int]) -> Array | None:
    """(n,) [rad/s]; None: it tells none, or NaN, as ros2_control does of who measures none."""
    if len(joints.velocities) != len(joints.names):
        return None
    rates = np.array([joints.velocities[k] for k in order])
    return None if np.isnan(rates).any() else rates


def _index(names: tuple[str, ...], name: str) -> int:
    return names.index(name) if name in names else -1
