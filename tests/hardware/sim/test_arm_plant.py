"""A simulated arm: it follows a twist with lag, in steps, within the limits of its joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.arm.arm_model import ArmError
from hardware.follower import TwistCommand
from hardware.plant_parameters import NO_SENSORS
from hardware.sim.plant.arm_plant import ArmPlant
from hardware.sim.simulated import Gripping
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.frames import GRAVITY
from tests.hardware.arm.arms import AXES, PARAMETERS, SO101

DRIVE = SO101.robot.twist
STILL = np.zeros(6)
TICK_S = 0.005


def plant(seed=0):
    return ArmPlant(PARAMETERS, DRIVE, AXES, NO_SENSORS, np.random.default_rng(seed))


def along(axis, size):
    twist = np.zeros(6)
    twist[axis] = size
    return twist


def test_it_begins_at_rest_level_at_the_origin_and_sags_by_less_than_a_millimetre():
    arm = plant()
    assert arm.p_bf_in_f == pytest.approx(np.zeros(3), abs=1e-9)
    assert arm.R_fb == pytest.approx(np.eye(3), abs=1e-3)
    assert arm.wxyz_fb == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-3)
    for _ in range(200):
        arm.step(STILL)
    assert np.linalg.norm(arm.p_bf_in_f) < 1e-3
    assert np.linalg.norm(arm.twist_in_b) < 1e-4
    omega, felt = arm.imu()
    assert omega == pytest.approx(np.zeros(3), abs=1e-3)
    assert felt == pytest.approx([0.0, 0.0, GRAVITY], abs=0.05)


@pytest.mark.parametrize(("axis", "size"), [(0, 0.1), (1, 0.1), (2, -0.1), (3, 0.5), (4, 0.5)])
def test_it_follows_each_axis_that_it_is_led_along_by_the_lag_of_its_file(axis, size):
    arm, rows = plant(), []
    pulse_s = 2.0 * np.pi * 1.5 * TICK_S
    for k in range(400):
        arm.step(along(axis, size * np.sin(pulse_s * k)))
        rows.append([size * np.sin(pulse_s * k), arm.twist_in_b[axis], arm.given[axis]])
    told, moves, says = np.array(rows[133:]).T
    wave = np.exp(-1j * pulse_s * np.arange(len(told)))
    response, honest = (moves @ wave) / (told @ wave), (says @ wave) / (moves @ wave)
    lag_s = -np.angle(response) / (2.0 * np.pi * 1.5)
    assert abs(response) == pytest.approx(1.0, abs=0.1)
    assert lag_s == pytest.approx(DRIVE.lag_s + DRIVE.delay_s, abs=0.008)
    assert abs(honest) == pytest.approx(1.0, abs=0.05)
    assert abs(np.angle(honest)) / (2.0 * np.pi * 1.5) < 0.004


def hurried(seed, seconds=10.0):
    """By twists that are larger than it may follow, and more sudden: (rates, angles), (k, n)."""
    arm, rng, angles = plant(seed), np.random.default_rng(seed), []
    for k in range(round(seconds / TICK_S)):
        if k % 60 == 0:
            twist = rng.normal(size=6) * np.repeat((0.5, 3.0), 3)
        arm.step(twist)
        angles.append(arm.angles)
    return np.diff(angles, axis=0) / TICK_S, np.array(angles), arm


@pytest.mark.parametrize("seed", [1, 2])
def test_it_never_turns_a_joint_beyond_its_range_or_faster_than_its_file_says(seed):
    rates, angles, arm = hurried(seed)
    assert np.abs(rates).max() < PARAMETERS.rate
    assert (angles > arm.arm.low).all()
    assert (angles < arm.arm.high).all()
    assert np.ptp(angles, axis=0).max() > 0.5


def test_it_is_the_same_for_a_seed():
    (_, one, _), (_, again, _) = hurried(3, 1.0), hurried(3, 1.0)
    assert (one == again).all()


def test_told_zero_it_stands_little_later_than_its_brakes_need():
    arm = plant()
    for _ in range(60):
        arm.step(along(1, DRIVE.speed))
    assert np.linalg.norm(arm.twist_in_b[:3]) > 0.2
    speeds = []
    for _ in range(100):
        arm.step(STILL)
        speeds.append(np.linalg.norm(arm.twist_in_b[:3]))
    stands = next(k for k, v in enumerate(speeds) if v < 0.005)
    assert TICK_S * stands < DRIVE.stop_s + DRIVE.delay_s + 0.05
    assert max(speeds[60:]) < 0.002


def test_where_it_goes_is_where_it_then_is():
    arm = plant()
    for _ in range(100):
        arm.step(along(0, 0.1))
    ahead = arm.ahead(0.05)
    for _t, wxyz, p in ahead:
        arm.step(along(0, 0.1))
        assert arm.p_bf_in_f == pytest.approx(p, abs=0.0005)
        assert arm.wxyz_fb == pytest.approx(wxyz, abs=0.002)
    assert ahead[-1][0] == pytest.approx(0.05)


def test_where_it_goes_is_what_it_was_told_last_not_how_it_moves_yet():
    arm = plant()
    for _ in range(100):
        arm.step(along(0, 0.1))
    arm.step(along(2, 0.1))
    ahead, begun = arm.ahead(0.06), arm.p_bf_in_f
    for _t, _, p in ahead:
        arm.step(along(2, 0.1))
        assert arm.p_bf_in_f == pytest.approx(p, abs=0.001)
    assert np.linalg.norm(arm.p_bf_in_f - begun - 0.06 * along(0, 0.1)[:3]) > 0.004


def test_a_joint_without_a_servo_is_named(tmp_path):
    text = PARAMETERS.model.read_text()
    lacking = '<position name="elbow_flex" joint="elbow_flex"/>'
    assert lacking in text
    (tmp_path / "so101.xml").write_text(text.replace(lacking, ""))
    arm = replace(PARAMETERS, model=tmp_path / "so101.xml")
    with pytest.raises(ArmError, match=r"arm\.model: a position servo for .* elbow"):
        ArmPlant(arm, DRIVE, AXES, NO_SENSORS, np.random.default_rng(0))


def used(arm, wanted, seconds):
    """How far its tool is open after so long."""
    for _ in range(round(seconds / TICK_S)):
        arm.use_tool(wanted)
        arm.step(STILL)
    return arm.opening


def test_its_tool_opens_and_closes_within_its_stroke_and_stays_where_it_is_left():
    arm = plant()
    assert used(arm, 1.0, 0.5) == pytest.approx(0.55, abs=0.06)
    left = used(arm, None, 0.1)
    assert used(arm, None, 0.5) == pytest.approx(left, abs=0.02)
    assert used(arm, 1.0, 1.0) == pytest.approx(1.0, abs=0.02)
    assert used(arm, 0.0, 1.5) == pytest.approx(0.0, abs=0.02)
    assert np.linalg.norm(arm.p_bf_in_f) < 2e-3  # the tip stays


def test_a_robot_is_told_of_its_tool_by_the_link_and_stays_without_word():
    follower = VirtualTimeFollower(SO101)
    arm = follower.body
    assert isinstance(arm, Gripping)

    def fly(seconds, command, wanted):
        for _ in range(round(seconds / TICK_S)):
            follower.advance()
            follower.receive()
            follower.send(command)
            if wanted is not None:
                follower.use_tool(wanted)
        return arm.opening

    begins = fly(0.8, TwistCommand.zero(), 1.0)  # its handshake: it does not follow yet
    assert begins < 0.6
    follows = TwistCommand(np.array([0.0, 0.0, 1e-3, 0.0, 0.0, 0.0]), armed=True)
    assert fly(1.2, follows, 1.0) == pytest.approx(1.0, abs=0.02)
    assert fly(0.3, follows, 0.0) == pytest.approx(0.7, abs=0.06)
    left = fly(0.3, follows, None)
    assert fly(1.0, follows, None) == pytest.approx(left, abs=0.02)
