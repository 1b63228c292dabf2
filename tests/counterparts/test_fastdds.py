"""Another maker's DDS judges the bytes of the link to ROS 2, and speaks to it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("cyclonedds", reason="NO CYCLONE DDS: pip install 'lightleash[ros2]'")

from hardware.follower import FollowerState, TwistCommand
from hardware.link.address import ANYBODY
from hardware.link.base_end import HeardImu, HeardOdometry
from hardware.link.registry import connect
from hardware.link.ros2.ports import RosPorts
from hardware.pose_setpoint import BasePose
from pipeline.frames import wxyz_from_R
from tests.counterparts.fastdds_base import FastDdsBase, NoFastDdsError, program
from tests.hardware.link.ros2.ros2_rig import (
    BELOW,
    LOCALHOST,
    PATIENCE_S,
    arm_robot,
    patiently,
    ros2_robot,
)

pytestmark = pytest.mark.counterpart
SAYS = (0.125, -0.25, 0.0, 0.5, -1.5, 9.75)
"""Gyroscope and accelerometer of a base at rest."""
FIRST = (1e-4, *5 * (0.0,))
FORWARD = TwistCommand(np.array([0.25, *5 * (0.0,)]), armed=True)


@pytest.fixture(scope="module", autouse=True)
def built():
    try:
        return program()
    except NoFastDdsError as error:
        pytest.skip(str(error))


def told(base):
    """Stamps [s] and twists (n, 6) that it was told, bit by bit."""
    time.sleep(0.5)
    lines = [line.split() for line in base.end()]
    lines = [line for line in lines if line[0] == "twist"]
    stamps = [int(line[1]) + 1e-9 * int(line[2]) for line in lines]
    return stamps, np.array([[float.fromhex(one) for one in line[3:]] for line in lines])


@pytest.mark.parametrize("host", [LOCALHOST, ANYBODY])
@pytest.mark.parametrize("words", [(), ("stamped",)])
def test_it_hears_each_twist_once_bit_by_bit_and_what_it_says_is_heard(host, words):
    topics = ros2_robot(message="TwistStamped" if words else "Twist").link.ros2
    ports = RosPorts(topics, host)
    base, heard = FastDdsBase(topics.domain, BELOW, *words), []
    for _ in patiently():
        heard += ports.heard()
        ports.tell(np.array(FIRST))
        moves = {one.twist_in_b for one in heard if isinstance(one, HeardOdometry)}
        if FIRST in moves:  # so it hears us
            break
    wanted = np.random.default_rng(1).normal(size=(100, 6))
    for row in wanted:
        assert ports.tell(row)
        time.sleep(0.005)
    ports.close()
    stamps, twists = told(base)
    assert np.array_equal(twists[(twists != FIRST).any(axis=1)], wanted)
    if words:
        assert (np.diff(stamps) > 0.0).all()
        assert stamps[-1] == pytest.approx(time.time(), abs=PATIENCE_S)
    imus = [one for one in heard if isinstance(one, HeardImu)]
    assert {(*one.omega_in_i, *one.a_in_i) for one in imus} == {SAYS}
    assert (np.diff([one.stamp_us for one in imus]) > 0).all()
    assert moves <= {(0.0,) * 6, FIRST}


def test_an_arm_hears_each_pose_once_bit_by_bit_and_its_joints_are_heard():
    topics = arm_robot(command="target").link.ros2
    ports, arm = RosPorts(topics, LOCALHOST), FastDdsBase(topics.domain, BELOW, name="arm")
    heard = []
    for _ in patiently():
        heard += ports.heard()
        if heard and ports.tell_pose(None):
            break
    rng, wanted = np.random.default_rng(2), []
    for _ in range(100):
        pose = BasePose(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3), "odom")
        assert ports.tell_pose(pose)
        w, x, y, z = wxyz_from_R(pose.R_kb)
        wanted.append([*pose.p_bk_in_k, x, y, z, w])
        time.sleep(0.005)
    time.sleep(0.5)
    ports.close()
    lines = [line.split() for line in arm.end()]
    assert {(line[0], line[3]) for line in lines} == {("pose", "odom")}
    assert np.array_equal([[float.fromhex(one) for one in line[4:]] for line in lines], wanted)
    assert int(lines[-1][1]) == pytest.approx(time.time(), abs=PATIENCE_S)
    assert {(one.names, one.positions, one.velocities) for one in heard} == {
        (("gripper", "lift", "turn"), (0.125, -0.5, 1.75), (0.0, 0.25, -1.5))
    }
    assert (np.diff([one.stamp_us for one in heard]) > 0).all()


class Led:
    """A base that is led forward."""

    def __init__(self, *words):
        robot_file = ros2_robot()
        self.follower = connect(robot_file, bytes(16), 1)
        self.base = FastDdsBase(robot_file.link.ros2.domain, BELOW, *words)
        self.samples = []

    def runs(self):
        for _ in patiently():
            self.samples += self.follower.receive()
            states = [sample.state for sample in self.samples]
            goes = states and states[-1] in (FollowerState.IDLE, FollowerState.RUNNING)
            self.follower.send(FORWARD if goes else TwistCommand.zero())
            if states.count(FollowerState.RUNNING) > 200:
                return


def test_it_is_led_says_how_it_moves_and_is_told_zero_by_the_last_word():
    led = Led()
    led.runs()
    led.follower.close()
    _, twists = told(led.base)
    assert twists[:, 0].max() == FORWARD.twist_in_b[0]
    assert not twists[-1].any()
    assert max(sample.twist_in_b[0] for sample in led.samples) == FORWARD.twist_in_b[0]
    assert (np.diff([sample.t_us for sample in led.samples]) > 0).all()


def test_bytes_that_are_no_message_are_dropped_and_lead_nobody_astray():
    """Most by Cyclone DDS itself, with a line on standard error; the rest is counted here."""
    led = Led("garbage")
    led.runs()
    assert led.follower.dropped > 100
    assert {(*one.omega_in_b[:2], *one.a_in_b) for one in led.samples} == {SAYS[:2] + SAYS[3:]}
    led.follower.close()
    led.base.end()
