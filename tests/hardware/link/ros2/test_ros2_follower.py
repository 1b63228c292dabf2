"""A base of ROS 2 by real DDS, in virtual time: the contract, and what DDS alone can go wrong."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="NO CYCLONE DDS: pip install 'lightleash[ros2]'")

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy
from cyclonedds.topic import Topic

from hardware.contract import TwistFollowerContract, exchange
from hardware.contract.of_twists import SETTLE_S, SILENT_S
from hardware.follower import FollowerError, FollowerState, TwistCommand
from hardware.link.address import ANYBODY
from hardware.link.registry import connect
from hardware.link.robot_end import LinkLimits
from hardware.link.ros2.messages import RosImu
from hardware.link.ros2.ports import TELLS
from tests.hardware.link.ros2.lab_base import (
    DEFAULT,
    Imu,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    TwistStamped,
    imu_message,
    odometry_message,
)
from tests.hardware.link.ros2.ros2_rig import (
    BELOW,
    TIMELESS,
    TWISTER,
    Ros2Rig,
    pose_robot,
    ros2_robot,
)

FORWARD = TwistCommand(np.array([0.25, 0.0, 0.0, 0.0, 0.0, 0.5]), armed=True)
KEY = bytes(16)


@pytest.fixture
def rig():
    rig = Ros2Rig()
    yield rig
    rig.close()


class TestContract(TwistFollowerContract):
    @pytest.fixture
    def rig(self, rig):
        return rig


class TestContractOfTwistStamped(TwistFollowerContract):
    @pytest.fixture
    def rig(self):
        rig = Ros2Rig(ros2_robot(message="TwistStamped"), kind=TwistStamped)
        yield rig
        rig.close()


class TestContractOfPoseStamped(TwistFollowerContract):
    @pytest.fixture
    def rig(self):
        rig = pose_rig()
        yield rig
        rig.close()

    def test_silence_ends_in_zero_that_only_a_new_handshake_ends(self, rig):
        """Told nothing more, it goes to its pose and stands: sooner than one that takes a twist."""
        self.ready(rig)
        self.fly(rig, 4.0, 0.5)
        rig.follower.receive()
        silent = self.listen(rig, SILENT_S + SETTLE_S)
        assert self.given(silent[2]).min() > 2.0
        assert self.given(silent[-1]).max() < 0.05
        rig.advance(0.2)
        assert rig.follower.receive()[-1].state == FollowerState.REFUSING
        assert self.given(self.fly(rig, 2.0, 0.5)[-1]).max() < 1e-4
        self.ready(rig)

    def test_a_lost_link_is_no_error_but_silence(self, rig):
        """Without motion sensors it is known for 0.1 s and some intervals how it moves."""
        self.ready(rig)
        rig.cut_link()
        self.fly(rig, 1.0, 0.15)
        assert self.fly(rig, 1.0, 0.2) == []


def pose_rig():
    return Ros2Rig(pose_robot(), kind=PoseStamped)


def lead(rig, seconds, command=FORWARD):
    samples = []
    for _ in range(round(seconds / 0.005)):
        samples += exchange(rig.follower, command)
        rig.advance(0.005)
    return samples


def running(rig):
    lead(rig, 0.7, TwistCommand.zero())
    samples = lead(rig, 0.4)
    assert samples[-1].state == FollowerState.RUNNING
    rig.base.taken.clear()
    return rig


def test_each_command_comes_once_and_as_it_was_given(rig):
    running(rig)
    lead(rig, 1.0)
    assert len(rig.base.taken) == 200
    assert all((twist == FORWARD.twist_in_b).all() for _, _, twist in rig.base.taken)
    assert rig.follower.lost == 0


def test_a_header_has_the_time_at_which_it_was_said():
    rig = Ros2Rig(ros2_robot(message="TwistStamped"), kind=TwistStamped)
    running(rig)
    lead(rig, 0.1)
    for now, stamp, _ in rig.base.taken:
        assert stamp == pytest.approx(now - 0.005 + rig.stamp - rig.now, abs=1e-6)
    rig.close()


def test_one_that_takes_poses_goes_as_far_as_its_twist_says_and_is_then_left_alone():
    rig = pose_rig()
    lead(rig, 0.7, TwistCommand.zero())
    assert rig.base.taken == []  # whoever else moves it is not pulled back
    began = rig.body.p_in_f
    samples = lead(rig, 1.0)
    lead(rig, 1.0, TwistCommand.zero())
    told = np.array([sample.twist_in_b for sample in samples])
    assert told[-1] == pytest.approx(FORWARD.twist_in_b, abs=1e-3)
    turned = 2.0 * math.asin(rig.base.goal.orientation.z)
    assert turned == pytest.approx(0.5, abs=0.06)  # it begins and ends within its accelerations
    radius = 0.25 / 0.5
    gone = radius * np.array([math.sin(turned), 1.0 - math.cos(turned), 0.0])
    assert rig.body.p_in_f - began == pytest.approx(gone, abs=5e-3)
    taken = len(rig.base.taken)
    lead(rig, 0.5, TwistCommand.zero())
    assert len(rig.base.taken) == taken
    rig.close()


def test_one_that_takes_poses_is_not_led_without_saying_where_it_is():
    """A quaternion of zeros is how a driver says that it has no pose."""
    rig = pose_rig()
    lead(rig, 0.7, TwistCommand.zero())
    rig.base.connected = False
    dropped = rig.follower.dropped
    for _ in range(100):
        nowhere = Pose(Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 0.0))
        rig.base.odometry.write(odometry_message(rig.stamp, 6 * [0.0], nowhere))
        lead(rig, 0.005)
    assert rig.follower.dropped == dropped + 100
    assert rig.base.taken == []
    rig.close()


def test_one_that_takes_poses_begins_anew_where_it_is_when_its_driver_has_started_anew():
    rig = pose_rig()
    lead(rig, 0.7, TwistCommand.zero())
    lead(rig, 0.5)
    lead(rig, 1.0, TwistCommand.zero())
    rig.now += 2.0
    rig.body.p_in_f = rig.body.p_in_f - np.array([0.02, 0.0, 0.0])  # where its odometry begins
    p, rig.base.goal = rig.body.p_in_f, None
    rig.base.taken.clear()
    rig.started_s = 60.0
    lead(rig, 0.7, TwistCommand.zero())
    samples = lead(rig, 0.1)
    assert samples[-1].state == FollowerState.RUNNING
    first = rig.base.taken[0][2].position
    assert [first.x, first.y, first.z] == pytest.approx(p, abs=2e-3)
    rig.close()


def test_stopped_the_last_words_are_zeros(rig):
    running(rig)
    lead(rig, 0.2)
    taken = len(rig.base.taken)
    rig.follower.stop()
    rig.base.listen(rig.now)
    last = [twist for _, _, twist in rig.base.taken[taken:]]
    assert last
    assert not np.any(last)


def test_commands_that_nobody_listens_to_are_counted_and_nobody_is_ready():
    rig = Ros2Rig(below="/elsewhere")
    samples = lead(rig, 0.5, TwistCommand.zero())
    assert samples == []
    assert rig.follower.lost == 100
    rig.close()


def test_a_base_without_odometry_and_with_an_imu_turned_is_led_the_same():
    rig = Ros2Rig(ros2_robot(odometry=None, imu_axes=["y", "-x", "z"]), odometry=False)
    running(rig)
    sample = lead(rig, 0.3)[-1]
    assert sample.twist_in_b == pytest.approx(FORWARD.twist_in_b)
    assert sample.a_in_b[2] == pytest.approx(9.8, abs=1.0)
    rig.close()


def test_an_imu_that_has_no_gyroscope_is_none(rig):
    rig.base.connected = False
    for _ in range(20):
        rig.advance(0.005)
        rig.base.odometry.write(odometry_message(rig.stamp, 6 * [0.0]))
        rig.base.imu.write(imu_message(rig.stamp, 3 * [0.0], [0.0, 0.0, 9.8], gyro_missing=True))
        assert exchange(rig.follower, TwistCommand.zero()) == []
    assert rig.follower.dropped >= 19


def stranger(rig):
    """Somebody else's publisher of the same topic, who may write before, between, after."""
    participant = DomainParticipant(rig.topics.domain)
    return DataWriter(participant, Topic(participant, f"rt{BELOW}/imu", Imu), qos=DEFAULT)


def test_who_else_publishes_the_topic_is_not_believed(rig):
    other = stranger(rig)
    running(rig)
    dropped, samples = rig.follower.dropped, []
    for _ in range(100):
        other.write(imu_message(rig.stamp + 0.001, [3.0, 0.0, 0.0], [0.0, 0.0, 9.8]))
        samples += lead(rig, 0.005)
    assert max(abs(sample.omega_in_b[0]) for sample in samples) < 2.0
    assert samples[-1].state == FollowerState.RUNNING
    assert rig.follower.dropped == dropped + 100


def test_what_can_not_be_read_takes_nothing_else_with_it(rig, monkeypatch):
    running(rig)
    read = RosImu.deserialize
    damaged = [0]

    def reads(data, *arguments, **words):
        damaged[0] += 1
        return read(data[:40] if damaged[0] % 2 else data, *arguments, **words)

    monkeypatch.setattr(RosImu, "deserialize", reads)
    dropped = rig.follower.dropped
    samples = lead(rig, 0.5)
    assert rig.follower.dropped == dropped + 50
    assert len(samples) == 50
    assert samples[-1].state == FollowerState.RUNNING


def test_a_command_that_was_lost_comes_no_later_than_one_of_our_own_link_is_taken():
    assert TELLS[Policy.Lifespan].lifespan == 1000 * LinkLimits.of(TWISTER).max_age_us
    assert TELLS[Policy.History.KeepLast].depth == 1


@pytest.mark.parametrize(("tells", "comes"), [(TELLS, 0), (TIMELESS, 1)])
def test_the_wall_alone_makes_a_command_old(tells, comes):
    """Why virtual time is led without: a collection of garbage is such a pause."""
    rig = running(Ros2Rig(tells=tells))
    exchange(rig.follower, FORWARD)
    time.sleep(1.5e-9 * TELLS[Policy.Lifespan].lifespan)
    rig.base.listen(rig.now)
    assert len(rig.base.taken) == comes
    rig.close()


def test_two_links_in_one_domain_of_a_process_are_refused_by_name(rig):
    with pytest.raises(FollowerError, match=r"link\.ros2\.domain"):
        connect(rig.robot_file, KEY, 2)


def test_after_it_has_gone_the_domain_is_free_again():
    robot_file, kept = ros2_robot(), []
    for epoch in range(1, 4):
        kept.append(connect(robot_file, KEY, epoch))
        kept[-1].close()


def test_a_host_that_nobody_knows_is_named():
    link = replace(ros2_robot().link, host="no-such-host.invalid")
    with pytest.raises(FollowerError, match=r"no-such-host\.invalid.*found by multicast"):
        connect(replace(ros2_robot(), link=link), KEY, 1)


def test_settings_that_cyclone_dds_does_not_read_are_named(monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Domain><Nonsense/></Domain></CycloneDDS>")
    with pytest.raises(FollowerError, match="CYCLONEDDS_URI"):
        connect(ros2_robot(), KEY, 1)


def test_it_may_be_looked_for_by_multicast():
    connect(ros2_robot().reached(ANYBODY, 7400), KEY, 1).close()
