"""The link to an autopilot, held to the contract and judged by pymavlink, in virtual time."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="NO PYMAVLINK: pip install pymavlink")

from hardware.contract import TwistFollowerContract, exchange
from hardware.follower import EXPLANATIONS, FollowerError, FollowerState, Refusal, TwistCommand
from hardware.link.base_end import KEEPS_WRITER_S
from hardware.link.mavlink.mavlink_follower import connect
from hardware.twist_schema import TOLD_ZERO_S
from pipeline.estimation.standing_camera import StandingPose
from tests.hardware.link.mavlink.lab_autopilot import OFFBOARD, POSCTL, LabAutopilot, twister
from tests.hardware.link.mavlink.mavlink_rig import (
    LOCALHOST,
    MEASURED,
    STAMP_BEFORE_S,
    MavlinkRig,
    free_port,
    led,
    mavlink_robot,
    told,
)

FORWARD = TwistCommand(np.array([0.25, 0.1, 0.05, 0.0, 0.0, 0.5]), armed=True)
KEY = bytes(16)
PERIOD_S = 0.005
FRESH_S = 0.04
"""So long a command may rest on the same sample."""


@pytest.fixture
def rig():
    rig = MavlinkRig()
    yield rig
    rig.close()


class LedByMavlink(TwistFollowerContract):
    leads = (0, 5)


class TestContract(LedByMavlink):
    @pytest.fixture
    def rig(self, rig):
        return rig


class TestContractOfOdometry(LedByMavlink):
    @pytest.fixture
    def rig(self):
        rig = MavlinkRig(mavlink_robot(twist_from="ODOMETRY", system=7))
        yield rig
        rig.close()


class TestContractWithoutMotionSensors(LedByMavlink):
    @pytest.fixture
    def rig(self):
        rig = MavlinkRig(mavlink_robot(MEASURED))
        yield rig
        rig.close()

    def test_a_lost_link_is_no_error_but_silence(self, rig):
        self.ready(rig)
        rig.cut_link()
        self.fly(rig, 1.0, rig.robot_file.robot.motion.lasts_s + 0.01)
        assert self.fly(rig, 1.0, 0.2) == []


def lead(rig, seconds, command=FORWARD):
    return led(rig, seconds, command)


def running(rig):
    lead(rig, 0.7, TwistCommand.zero())
    samples = lead(rig, 0.4)
    assert samples[-1].state == FollowerState.RUNNING
    rig.autopilot.taken.clear()
    return rig


def test_each_command_comes_once_and_as_it_was_given_whatever_the_heading(rig):
    running(rig)
    lost = rig.follower.lost
    lead(rig, 1.0)
    assert len(told(rig)) == 200
    assert np.abs(told(rig) - FORWARD.twist_in_b).max() < 1e-7
    assert rig.body.twist_in_b == pytest.approx(FORWARD.twist_in_b, abs=1e-3)
    assert rig.follower.lost == lost


@pytest.mark.slow
def test_pymavlink_reads_each_packet_in_its_order_and_nothing_is_lost(rig):
    running(rig)
    rig.autopilot.heard.clear()
    lead(rig, 4.0)
    heard = rig.autopilot.heard
    said = {kind: sum(one.get_type() == kind for one in heard) for kind in
            ("SET_POSITION_TARGET_LOCAL_NED", "HEARTBEAT", "TIMESYNC")}  # fmt: skip
    assert said["SET_POSITION_TARGET_LOCAL_NED"] == 800
    assert said["HEARTBEAT"] == 4
    assert said["TIMESYNC"] == 20 + 40  # ours, and answers to its
    assert len(heard) == sum(said.values())
    assert {one.get_srcComponent() for one in heard} == {191}
    assert {one.get_srcSystem() for one in heard} == {1}
    assert (np.diff([one.get_seq() for one in heard]) % 256 == 1).all()
    assert rig.autopilot.mav.total_receive_errors == 0
    assert rig.follower.dropped == 0


def test_stopped_the_last_words_are_zeros(rig):
    running(rig)
    lead(rig, 0.2)
    taken = len(rig.autopilot.taken)
    rig.follower.close()
    rig.autopilot.listen(rig.now, rig.stamp)
    assert len(rig.autopilot.taken) == taken + 5
    assert not told(rig)[taken:].any()


def test_before_anybody_has_spoken_nothing_is_sent_and_it_is_counted():
    rig = MavlinkRig()
    rig.cut_link()
    assert lead(rig, 0.5, TwistCommand.zero()) == []
    assert rig.follower.lost == 100
    assert rig.autopilot.heard == []
    rig.close()


def not_led(rig, why):
    samples = lead(rig, 0.6)
    assert {s.state for s in samples[-100:]} == {FollowerState.REFUSING}
    assert {s.refusal for s in samples[-100:]} == {why}
    assert not told(rig)[-100:].any()
    assert len(told(rig)) >= 100, "it is told zero all the while: PX4 takes no OFFBOARD without"


@pytest.mark.parametrize(
    ("switches", "why"), [((POSCTL, True), Refusal.MODE), ((OFFBOARD, False), Refusal.NOT_ARMED)]
)
def test_its_pilot_s_switch_ends_all_and_begins_nothing(rig, switches, why):
    running(rig)
    lead(rig, 0.2)
    rig.autopilot.set(*switches)
    assert lead(rig, 0.02)[-1].state == FollowerState.REFUSING
    rig.autopilot.taken.clear()
    not_led(rig, why)
    rig.autopilot.set()
    assert not any(s.state == FollowerState.RUNNING for s in lead(rig, 1.0)), "it began with zero"
    assert not told(rig).any()
    running(rig)


@pytest.mark.parametrize(
    ("switches", "why"), [((POSCTL, True), Refusal.MODE), ((OFFBOARD, False), Refusal.NOT_ARMED)]
)
def test_who_leads_is_told_why_it_does_not_begin(switches, why):
    rig = MavlinkRig()
    rig.autopilot.set(*switches)
    lead(rig, 0.1, TwistCommand.zero())
    not_led(rig, why)
    assert "pilot" in EXPLANATIONS[why]
    rig.autopilot.set()
    running(rig)
    rig.close()


@pytest.mark.slow
def test_one_that_says_nothing_of_its_mode_any_more_is_not_led(rig):
    running(rig)
    rig.autopilot.ticks = 1  # of 200
    rig.autopilot.heartbeat = lambda: rig.autopilot.status(12_000)
    lead(rig, 2.5)
    assert told(rig)[-1].any()
    lead(rig, 1.0)
    not_led(rig, Refusal.MODE)


def test_silence_is_zero_in_time_and_within_its_accelerations(rig):
    running(rig)
    rig.autopilot.speak = lambda _stamp: None
    rig.autopilot.taken.clear()
    lead(rig, 0.5)
    twists = told(rig)
    assert not twists[round((FRESH_S + TOLD_ZERO_S) / PERIOD_S) + 1 :].any()
    changes = np.linalg.norm(np.diff(twists[:, :3], axis=0), axis=1)
    assert changes.max() <= rig.autopilot.drive.acceleration * PERIOD_S * 1.001


@pytest.mark.slow
def test_a_line_that_loses_two_of_a_hundred_leads_as_well():
    rig = running(MavlinkRig(loss=0.02))
    samples = lead(rig, 10.0)
    assert {s.state for s in samples} == {FollowerState.RUNNING}
    assert 0.96 * 2000 < len(told(rig)) < 2000
    assert np.abs(told(rig) - FORWARD.twist_in_b).max() < 1e-7
    rig.close()


@pytest.mark.parametrize("booted", [STAMP_BEFORE_S, -4000.0])
def test_an_autopilot_that_starts_anew_begins_anew(rig, booted):
    """What TIMESYNC found of the clock before, it may be hours ahead, dates nothing any more."""
    rig.booted = booted
    running(rig)
    before = lead(rig, 0.15)[-1].boot_id  # and 0.05 s until TIMESYNC is asked again
    rig.booted = rig.now  # its clock begins at zero
    samples = lead(rig, 0.5)
    assert samples[-1].boot_id != before
    assert samples[-1].state == FollowerState.REFUSING
    running(rig)


def stranger(rig):
    """Another one of the same system and component, from another address."""
    return LabAutopilot(rig.follower.port, *twister(1))


def test_who_else_poses_as_it_is_dropped_and_told_nothing(rig):
    running(rig)
    other, dropped = stranger(rig), rig.follower.dropped
    other.set(POSCTL)
    for _ in range(200):
        other.step(rig.now, rig.stamp + 3.0)
        sample = lead(rig, PERIOD_S)[-1]
        assert sample.twist_in_b == pytest.approx(FORWARD.twist_in_b, abs=1e-3)
    assert sample.state == FollowerState.RUNNING
    assert other.heard == []
    assert rig.follower.dropped >= dropped + 600
    other.close()


@pytest.mark.slow
def test_another_takes_its_place_once_it_has_been_silent_and_begins_anew(rig):
    running(rig)
    rig.cut_link()
    lead(rig, KEEPS_WRITER_S + 0.1)
    rig.autopilot.close()
    rig.autopilot = stranger(rig)
    assert lead(rig, 0.4)[-1].state == FollowerState.REFUSING
    running(rig)


def test_other_components_and_systems_are_passed_over(rig):
    running(rig)
    rig.autopilot.mav.srcComponent = 100  # a camera's, by the same router
    rig.autopilot.set(POSCTL)
    rig.autopilot.mav.srcComponent, rig.autopilot.mav.srcSystem = 1, 255
    rig.autopilot.set(POSCTL)
    rig.autopilot.mav.srcSystem = 1
    assert lead(rig, 0.2)[-1].state == FollowerState.RUNNING
    assert rig.follower.dropped == 0


def test_one_host_alone_is_heard():
    rig = MavlinkRig(mavlink_robot(host="10.0.0.7"))
    assert lead(rig, 0.3, TwistCommand.zero()) == []
    assert rig.follower.dropped == 59
    rig.close()


def test_an_autopilot_of_mavlink_1_is_heard_and_answered_by_mavlink_2(rig):
    packed = rig.autopilot.heartbeat().pack(rig.autopilot.mav, force_mavlink1=True)
    rig.autopilot.socket.sendto(packed, rig.autopilot.ground)
    exchange(rig.follower, TwistCommand.zero())
    rig.follower.send(TwistCommand.zero())
    data = rig.autopilot.socket.recv(2048)
    assert packed[0] == 0xFE
    assert data[0] == 0xFD


def test_clocks_are_related_both_ways(rig):
    running(rig)
    lead(rig, 1.0)
    assert np.abs(np.array(rig.autopilot.offsets) - STAMP_BEFORE_S).max() < 2 * PERIOD_S
    assert max(rig.autopilot.round_trips) <= 2 * PERIOD_S


def test_a_twist_is_as_old_as_the_way_that_timesync_has_found():
    """The quickest stamp says that it took no time; half of the round trip says what it took."""
    late = MavlinkRig(mavlink_robot(MEASURED))
    way = [[] for _ in range(4)]  # of 5 ms each, either way
    at_once = late.autopilot.send

    def send(*messages):
        way.append(messages)
        at_once(*way.pop(0))

    late.autopilot.send = send
    running(late)
    ages = [s.twist_age_s for s in lead(late, 1.0)]
    assert min(ages) > 0.005
    late.close()


def test_where_a_standing_phone_saw_it_is_dated_by_the_picture_on_its_own_clock(rig):
    """Late by 150 ms, as pictures are: by a pose that is taken for new is how users fail."""
    running(rig)
    lead(rig, 1.0)
    rig.autopilot.heard.clear()
    place, covariance = np.array([2.0, 0.5, -0.25]), np.diag([0.01, 0.02, 0.03, 1e-4, 1e-4, 1e-4])
    rig.follower.see(StandingPose(rig.now - 0.15, place, np.eye(3), covariance, 258))
    rig.advance(PERIOD_S)
    (said,) = [one for one in rig.autopilot.heard if one.get_type() == "ODOMETRY"]
    captured = 1e-6 * said.time_usec - np.median(rig.autopilot.offsets)
    assert captured == pytest.approx(rig.stamp - PERIOD_S - 0.15, abs=PERIOD_S)
    assert (said.frame_id, said.child_frame_id) == (20, 12)  # LOCAL_FRD, BODY_FRD
    assert (said.x, said.y, said.z) == (2.0, -0.5, 0.25)
    assert said.q == [1.0, 0.0, 0.0, 0.0]
    assert said.pose_covariance[:12:6] == pytest.approx([0.01, 0.02])
    assert np.isnan([said.vx, said.yawspeed, said.velocity_covariance[0]]).all()
    assert (said.reset_counter, said.estimator_type) == (2, 2)


def test_what_is_seen_goes_nowhere_before_anybody_has_spoken_and_not_once_it_is_closed():
    rig = MavlinkRig(mavlink_robot(vision=True))
    seen = StandingPose(1.0, np.zeros(3), np.eye(3), np.eye(6), 1)
    rig.follower.see(seen)
    rig.advance(PERIOD_S)
    assert rig.autopilot.heard == []
    rig.close()
    with pytest.raises(FollowerError, match="closed"):
        rig.follower.see(seen)


@pytest.mark.parametrize("wants", [False, True])
def test_vision_is_wanted_by_the_file_alone(wants):
    follower = connect(mavlink_robot(vision=wants).reached(LOCALHOST, free_port()), KEY, 1)
    assert follower.wants_vision == wants
    follower.close()


def test_its_battery_is_heard(rig):
    running(rig)
    health, at = rig.follower.health
    assert health.battery_v == pytest.approx(11.9)
    assert rig.now - at < 1.1
    rig.autopilot.send(rig.autopilot.status(65_535))
    rig.follower.receive()
    assert rig.follower.health[0].battery_v is None


def test_a_port_that_somebody_has_is_named(rig):
    with pytest.raises(FollowerError, match=r"link\.port"):
        rig.leader(2, rig.follower.port)


def test_a_host_that_nobody_knows_is_named():
    with pytest.raises(FollowerError, match=r"no-such-host\.invalid.*whoever speaks first"):
        connect(mavlink_robot(host="no-such-host.invalid"), KEY, 1)
