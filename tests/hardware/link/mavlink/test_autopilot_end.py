"""What is believed of an autopilot and what it is told, without a socket or anybody's library."""

from __future__ import annotations

from math import cos, nan, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.follower import FollowerState, Refusal, TwistCommand
from hardware.link.address import ANYBODY
from hardware.link.mavlink import messages as mav
from hardware.link.mavlink.autopilot_end import AutopilotEnd
from hardware.link.mavlink.packets import MavlinkPacket, encoded, packets
from hardware.link.mavlink.pilot import LASTS_S, Pilot
from hardware.robot_file import robot_of, robot_path, robot_table

PEER = ("10.0.0.2", 14580)
PERIOD_S, BOOTED_S = 0.005, 30.0
OFFBOARD, ARMED = 6 << 16, 0x81
GRAVITY = (0.0, 0.0, -9.8)
FORWARD = np.array([0.25, 0.0, 0.0, 0.0, 0.0, 0.5])


def robot(**section):
    table = robot_table(robot_path("twister")) | {"axes": ["x", "y", "z", "yaw"]}
    link = {"kind": "mavlink", "takes": "twist", "host": "10.0.0.2", "mavlink": section}
    return robot_of(table | {"link": link}, "x")


class Led:
    """An autopilot that is led: says something each tick, is told something each tick."""

    def __init__(self, host=PEER[0], **section):
        robot_file = robot(**section)
        self.end = AutopilotEnd(robot_file, host, robot_file.link.mavlink, 1)
        self.now = 50.0
        self.attitude = mav.ATTITUDE, (0.0, 0.0, 0.0)
        self.v_in_n, self.omega_in_a = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        self.told, self.samples = [], []

    @property
    def ms(self):
        return round(1e3 * (self.now - BOOTED_S))

    def say(self, *said, sender=PEER):
        data = b"".join(encoded(MavlinkPacket(1, 1, kind, values), 0) for kind, values in said)
        self.samples += self.end.receive(data, sender, self.now)

    def speak(self):
        kind, attitude = self.attitude
        imu = (1000 * self.ms, *GRAVITY, *self.omega_in_a, *7 * (0.0,), 63)
        self.say(
            (mav.HEARTBEAT, (OFFBOARD, 2, 12, ARMED, 4, 3)),
            (kind, (self.ms, *attitude, *self.omega_in_a)),
            (mav.LOCAL_POSITION_NED, (self.ms, 0.0, 0.0, 0.0, *self.v_in_n)),
            (mav.HIGHRES_IMU, imu),
        )

    def ticks(self, seconds, twist_in_b=(0.0,) * 6):
        self.told, self.samples = [], []
        twist = np.array(twist_in_b)
        for _ in range(round(seconds / PERIOD_S)):
            self.now += PERIOD_S
            self.speak()
            going = self.end.command(TwistCommand(twist, armed=bool(twist.any())), self.now)
            (set_point,) = packets(going[0])
            self.told.append((*set_point.values[4:7], set_point.values[11]))
        return self

    @property
    def state(self):
        return self.samples[-1].state


def led(**section):
    led = Led(**section).ticks(0.7).ticks(0.3, FORWARD)
    assert led.state == FollowerState.RUNNING
    return led


def test_a_set_point_is_velocity_and_yaw_rate_forward_right_down():
    assert led().told[-1] == pytest.approx((0.25, 0.0, 0.0, -0.5))


@pytest.mark.parametrize("is_quaternion", [False, True])
def test_one_that_leans_forward_is_not_told_to_descend_by_what_goes_forward(is_quaternion):
    leaning = led()
    angle = radians(-20.0)  # nose down
    leaning.attitude = mav.ATTITUDE, (0.0, angle, 1.0)
    if is_quaternion:
        q = np.array([cos(0.5) * cos(angle / 2), -sin(0.5) * sin(angle / 2),
                      cos(0.5) * sin(angle / 2), sin(0.5) * cos(angle / 2)])  # fmt: skip
        leaning.attitude = mav.ATTITUDE_QUATERNION, tuple(q)
    level_in_b = np.array([cos(angle), 0.0, -sin(angle)])  # level, ahead: up along its own z
    leaning.ticks(0.3, [*(0.2 * level_in_b), 0.0, 0.0, 0.0])
    assert leaning.state == FollowerState.RUNNING
    assert leaning.told[-1] == pytest.approx((0.2, 0.0, 0.0, 0.0), abs=1e-6)


def test_samples_are_in_our_axes_and_of_its_clock():
    flies = led()
    flies.attitude = mav.ATTITUDE, (0.0, 0.0, radians(90.0))  # nose to the east
    flies.v_in_n, flies.omega_in_a = (-0.1, 0.2, 0.05), (0.01, 0.02, 0.03)
    sample = flies.ticks(0.1).samples[-1]
    # east is forward, north is left, up is up
    assert sample.twist_in_b == pytest.approx([0.2, -0.1, -0.05, 0.01, -0.02, -0.03], abs=1e-6)
    assert sample.omega_in_b == pytest.approx([0.01, -0.02, -0.03], abs=1e-6)
    assert sample.a_in_b == pytest.approx([0.0, 0.0, 9.8], abs=1e-6)
    assert sample.t_us == 1000 * flies.ms


def says_odometry(flies, twist_frame, frame=mav.MAV_FRAME_LOCAL_NED):
    """From now on, at a heading of 1 rad."""

    def speak():
        q, twist = (cos(0.5), 0.0, 0.0, sin(0.5)), (0.1, 0.2, 0.3, 0.01, 0.02, 0.03)
        frames = frame, twist_frame
        odometry = 1000 * flies.ms, 0.0, 0.0, 0.0, *q, *twist, *42 * (nan,), *frames, 0, 0, 0
        imu = 1000 * flies.ms, *GRAVITY, *3 * (0.0,), *7 * (0.0,), 63
        flies.say((mav.HEARTBEAT, (OFFBOARD, 2, 12, ARMED, 4, 3)))
        flies.say((mav.ODOMETRY, odometry), (mav.HIGHRES_IMU, imu))

    flies.speak = speak
    return flies


def test_odometry_says_attitude_and_twist_at_once():
    flies = says_odometry(Led(twist_from="ODOMETRY"), mav.MAV_FRAME_BODY_FRD)
    sample = flies.ticks(0.1).samples[-1]
    assert sample.twist_in_b == pytest.approx([0.1, -0.2, -0.3, 0.01, -0.02, -0.03], abs=1e-6)
    dropped = flies.end.dropped
    says_odometry(flies, mav.MAV_FRAME_BODY_NED).ticks(0.3)
    assert flies.samples[-1].t_us < 1000 * (flies.ms - 150), "only until the last twist is old"
    assert flies.end.dropped >= dropped + 60


@pytest.mark.parametrize("frame", [mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_LOCAL_FRD])
def test_a_velocity_in_the_axes_of_the_pose_is_turned_into_the_body_s(frame):
    """So PX4 says its own; its rates are the body's all the same."""
    sample = says_odometry(Led(twist_from="ODOMETRY"), frame, frame).ticks(0.1).samples[-1]
    ahead, right = 0.1 * cos(1.0) + 0.2 * sin(1.0), 0.2 * cos(1.0) - 0.1 * sin(1.0)
    assert sample.twist_in_b == pytest.approx([ahead, -right, -0.3, 0.01, -0.02, -0.03], abs=1e-6)


@pytest.mark.parametrize(("frame", "twist_frame"), [(20, 1), (1, 20), (4, 4), (8, 8), (21, 21)])
def test_a_velocity_in_axes_that_no_attitude_is_told_of_is_dropped(frame, twist_frame):
    flies = says_odometry(Led(twist_from="ODOMETRY"), twist_frame, frame).ticks(0.1)
    assert flies.samples == []


@pytest.mark.parametrize(
    "attitude",
    [
        (mav.ATTITUDE, (nan, 0.0, 0.0)),
        (mav.ATTITUDE, (0.0, np.inf, 0.0)),
        (mav.ATTITUDE_QUATERNION, (0.0, 0.0, 0.0, 0.0)),
        (mav.ATTITUDE_QUATERNION, (nan, 0.0, 0.0, 1.0)),
    ],
)
def test_without_an_attitude_that_can_be_nothing_is_believed_and_nothing_told_but_numbers(attitude):
    lost = led()
    lost.attitude = attitude
    lost.ticks(0.6, FORWARD)
    assert np.isfinite(lost.told).all()
    assert not np.any(lost.told[-20:])
    assert lost.end.dropped > 100


def test_what_asks_the_time_is_answered_at_once_by_our_own():
    led_one = led()
    led_one.say((mav.TIMESYNC, (0, 77)))
    (answer,) = led_one.end.answers()
    (read,) = packets(answer)
    assert read.values == (round(1e9 * led_one.now), 77)
    assert led_one.end.answers() == []


def test_one_whose_timesync_is_of_another_clock_than_its_stamps_is_not_led_and_ends_nothing():
    flies = led()
    flies.now += 0.2
    going = flies.end.command(TwistCommand.zero(), flies.now)
    read = [packet for data in going for packet in packets(data)]
    (asked,) = (packet.values[1] for packet in read if packet.message == mav.TIMESYNC)
    flies.say((mav.TIMESYNC, (1_764_000_000_000_000_000, asked)))  # since 1970
    flies.ticks(0.7).ticks(0.3, FORWARD)
    assert (flies.state, flies.samples[-1].refusal) == (FollowerState.REFUSING, Refusal.STALE)
    assert not np.any(flies.told)


def test_whoever_speaks_first_may_be_it_where_the_file_says_so():
    anybody = Led(host=ANYBODY).ticks(0.7).ticks(0.3, FORWARD)
    assert anybody.state == FollowerState.RUNNING
    assert anybody.end.peer == PEER


ROVER, QUADROTOR, PLANE, SUBMARINE = 10, 2, 1, 12
ARDUPILOT, PX4 = 3, 12


@pytest.mark.parametrize(
    ("kind", "autopilot", "mode", "follows"),
    [
        (QUADROTOR, PX4, 6 << 16, True),
        (ROVER, PX4, 6 << 16 | 5 << 24, True),
        (QUADROTOR, PX4, 4 << 16, False),
        (QUADROTOR, PX4, 4, False),
        (QUADROTOR, ARDUPILOT, 4, True),
        (SUBMARINE, ARDUPILOT, 4, True),
        (QUADROTOR, ARDUPILOT, 15, False),
        (ROVER, ARDUPILOT, 15, True),
        (ROVER, ARDUPILOT, 4, False),
        (PLANE, ARDUPILOT, 4, False),
        (QUADROTOR, 8, 6 << 16, False),
    ],
)
def test_offboard_of_px4_and_guided_of_ardupilot_follow_and_nothing_else(
    kind, autopilot, mode, follows
):
    pilot = Pilot()
    assert pilot.why_not(0.0) == Refusal.MODE
    pilot.hear(mode, kind, autopilot, 0x01, 5.0)
    assert pilot.why_not(5.0) == (Refusal.NOT_ARMED if follows else Refusal.MODE)
    pilot.hear(mode, kind, autopilot, ARMED, 5.0)
    assert pilot.why_not(5.0) == (Refusal.NONE if follows else Refusal.MODE)
    assert pilot.why_not(5.0 + LASTS_S + 0.01) == Refusal.MODE


KINDS = st.sampled_from(sorted(mav.LAYOUTS))


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.lists(st.tuples(KINDS, st.binary(min_size=1, max_size=233)), max_size=8))
def test_whatever_it_says_it_is_told_numbers_within_its_limits(said):
    """The CRC is right; what stands in the fields is anything."""
    flies = led()
    for kind, content in said:
        layout = mav.LAYOUTS[kind]
        values = layout.read(content)
        flies.say((kind, values))
        going = flies.end.command(TwistCommand(FORWARD, armed=True), flies.now)
        for data in going:
            for packet in packets(data):
                assert np.isfinite(packet.values).all()
        (told,) = packets(going[0])
        assert np.linalg.norm(told.values[4:7]) <= 0.25 * (1 + 1e-6)
        assert abs(told.values[11]) <= 0.5 * (1 + 1e-6)
