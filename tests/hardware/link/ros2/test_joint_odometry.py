"""An arm's tip by the states of its joints, against MuJoCo itself, and by real DDS."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from hardware.link.base_end import BaseEnd, HeardJoints
from hardware.link.ros2.joint_odometry import JointOdometry
from tests.hardware.arm.arms import ARM, HOME, PARAMETERS, SO101

STEP_S, STAMP_US = 0.01, 1_700_000_000_000_000
SWINGS = np.array([0.3, -0.2, 0.4, 0.25, -0.5])
NAMES = ("gripper", *reversed(ARM.names))
"""As ROS has them: in any order, a gripper's among them."""


def angles(t):
    return HOME + SWINGS * np.sin(3.0 * t)


def rates(t):
    return 3.0 * SWINGS * np.cos(3.0 * t)


def joints(t, *, tells_rates=True, writer=1, names=NAMES):
    def row(values):
        return (0.1, *reversed(values.tolist()))

    velocities = row(rates(t)) if tells_rates else ()
    return HeardJoints(writer, STAMP_US + round(1e6 * t), names, row(angles(t)), velocities)


def tip(t):
    """(R_kb, p_bk_in_k), by MuJoCo and the model's file alone."""
    model = mujoco.MjModel.from_xml_path(str(PARAMETERS.model))
    data = mujoco.MjData(model)
    for name, angle in zip(ARM.names, angles(t), strict=True):
        data.joint(name).qpos = angle
    mujoco.mj_kinematics(model, data)
    site = data.site(PARAMETERS.tip)
    return site.xmat.reshape(3, 3).copy(), site.xpos.copy()


def moves(t):
    """Twist of the tip in b (6,), by its places about that time."""
    h = 1e-5
    (R_before, p_before), (R, _), (R_after, p_after) = tip(t - h), tip(t), tip(t + h)
    spin = (R_after - R_before) @ R.T / (2.0 * h)
    omega_in_k = 0.5 * np.array(
        [spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]
    )
    return np.concatenate((R.T @ (p_after - p_before) / (2.0 * h), R.T @ omega_in_k))


@pytest.mark.parametrize("t", [0.0, 0.3, 1.1])
def test_it_is_where_the_model_has_it_and_moves_as_its_joints_say(t):
    heard = JointOdometry(ARM, "base_link").heard(joints(t))
    R_kb, p_bk_in_k = tip(t)
    assert heard.pose.R_kb == pytest.approx(R_kb, abs=1e-9)
    assert heard.pose.p_bk_in_k == pytest.approx(p_bk_in_k, abs=1e-9)
    assert heard.pose.frame == "base_link"
    assert heard.twist_in_b == pytest.approx(moves(t), abs=1e-6)
    assert heard.stamp_us == STAMP_US + round(1e6 * t)


def test_without_rates_they_are_told_by_the_angles_between_two_messages():
    odometry = JointOdometry(ARM, "base_link")
    assert odometry.heard(joints(0.3, tells_rates=False)) is None
    heard = odometry.heard(joints(0.3 + STEP_S, tells_rates=False))
    assert heard.twist_in_b == pytest.approx(moves(0.3 + 0.5 * STEP_S), abs=5e-3)
    assert heard.stamp_us == STAMP_US + 305_000  # the time that the rates are of


@pytest.mark.parametrize("later_s", [0.0, -0.01, 0.4])
def test_no_rates_are_told_by_angles_of_no_time_or_long_ago(later_s):
    odometry = JointOdometry(ARM, "base_link")
    odometry.heard(joints(0.5, tells_rates=False))
    assert odometry.heard(joints(0.5 + later_s, tells_rates=False)) is None


def test_no_rates_are_told_by_the_angles_of_two_who_publish():
    odometry = JointOdometry(ARM, "base_link")
    odometry.heard(joints(0.5, tells_rates=False))
    assert odometry.heard(joints(0.51, tells_rates=False, writer=2)) is None


def test_joints_of_others_on_the_same_topic_say_nothing():
    odometry = JointOdometry(ARM, "base_link")
    for names, angles_of in ((("gripper",), (0.1,)), (NAMES[1:-1], 4 * (0.0,)), (NAMES, ())):
        assert odometry.heard(HeardJoints(1, STAMP_US, names, angles_of, angles_of)) is None


@pytest.mark.parametrize("which", [NAMES, NAMES[2:3]])
def test_rates_that_are_no_numbers_are_none(which):
    """So the broadcaster of ros2_control fills them in for joints that measure angles alone."""
    odometry, heard = JointOdometry(ARM, "base_link"), None
    for t in (0.3, 0.3 + STEP_S):
        told = joints(t)
        rows = zip(NAMES, told.velocities, strict=True)
        rates = tuple(np.nan if name in which else rate for name, rate in rows)
        heard = odometry.heard(replace(told, velocities=rates))
    assert heard.twist_in_b == pytest.approx(moves(0.3 + 0.5 * STEP_S), abs=5e-3)


def test_a_gripper_without_rates_takes_them_from_no_joint():
    told = joints(0.3)
    heard = JointOdometry(ARM, "base_link").heard(
        replace(told, velocities=(np.nan, *told.velocities[1:]))
    )
    assert heard.twist_in_b == pytest.approx(moves(0.3), abs=1e-6)


BROKEN = [(which, value) for which in ("positions", "velocities") for value in (np.inf, 1e300)]


@pytest.mark.parametrize(("which", "value"), [("positions", np.nan), *BROKEN])
def test_what_is_no_angle_and_no_rate_is_dropped_and_moves_nothing(which, value):
    end = BaseEnd(SO101, 1, np.eye(3), has_odometry=True, says_where=True)
    odometry, sound = JointOdometry(ARM, "base_link"), joints(0.3)
    assert end.hear(odometry.heard(sound), 10.0) is None
    before = end.pose
    assert end.dropped == 0
    row = (*getattr(sound, which)[:-1], value)
    broken = replace(sound, stamp_us=STAMP_US + 310_000, **{which: row})
    end.hear(odometry.heard(broken), 10.01)
    assert end.dropped == 1
    assert end.pose is before
