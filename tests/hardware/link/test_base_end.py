"""What is believed of a base without key or gate, and what it is told, without a socket."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import NOT_MEASURED, FollowerState, Refusal, TwistCommand
from hardware.link.base_end import (
    KEEPS_WRITER_S,
    ODOMETRY_LASTS_S,
    BaseEnd,
    HeardImu,
    HeardOdometry,
)
from hardware.link.robot_end import LinkLimits
from hardware.robot_file import COMMANDS, load_robot, robot_of, robot_path, robot_table
from hardware.sim.plant.twist_plant import TwistPlant
from hardware.twist_schema import TOLD_ZERO_S

TWISTER = load_robot("twister", takes=COMMANDS)
DRIVE = TWISTER.robot.twist
STRAIGHT = np.eye(3)
BASE, STRANGER = 11, 12
PERIOD_S = 0.005
FRESH_S = LinkLimits.of(TWISTER).max_age_us / 1e6
"""So long a command may rest on the same sample."""
MOVING = np.array([0.25, 0.0, 0.0, 0.0, 0.0, 0.5])
GRAVITY = (0.0, 0.0, 9.8)


class Led:
    """A base that is led: says something each tick, is told something each tick."""

    def __init__(self, R_bi=STRAIGHT, has_odometry=True):
        self.end, self.now = BaseEnd(TWISTER, 1, R_bi, has_odometry=has_odometry), 10.0
        self.stamp_ahead, self.writer = 1_000.0, BASE
        self.late = 0.0
        """How long what it says is on its way [s]."""
        self.told, self.samples = [], []
        self.speaks, self.has_odometry = True, has_odometry

    def imu(self, **changes):
        stamp_us = round(1e6 * (self.now - self.late + self.stamp_ahead))
        said = HeardImu(self.writer, stamp_us, (0.1, 0.2, 0.3), GRAVITY, True)
        return self.end.hear(replace(said, **changes), self.now)

    def odometry(self, twist=(0.0,) * 6, writer=BASE):
        return self.end.hear(HeardOdometry(writer, twist), self.now)

    def tick(self, twist_in_b=(0.0,) * 6):
        self.now += PERIOD_S
        if self.has_odometry:
            assert self.odometry() is None
        if self.speaks and (sample := self.imu()) is not None:
            self.samples.append(sample)
        twist = np.array(twist_in_b)
        command = TwistCommand(twist, armed=bool(twist.any()))
        self.told.append(self.end.command(command, self.now))

    def ticks(self, seconds, twist_in_b=(0.0,) * 6):
        self.told, self.samples = [], []
        for _ in range(round(seconds / PERIOD_S)):
            self.tick(twist_in_b)
        return self

    @property
    def state(self):
        return self.samples[-1].state


@pytest.fixture
def led():
    led = Led().ticks(0.7).ticks(0.5, MOVING)
    assert led.state == FollowerState.RUNNING
    assert (led.told[-1] == MOVING).all()
    return led


def test_nothing_moves_before_half_a_second_of_zero():
    assert not np.any(Led().ticks(1.0, MOVING).told)


def test_held_and_stopped_it_is_told_zero_each_time(led):
    led.ticks(1.0)
    assert len(led.told) == 200
    assert not np.any(led.told)
    assert led.state == FollowerState.IDLE
    led.ticks(0.3, MOVING)
    stop = TwistCommand(np.zeros(6), armed=False, stop=True)
    assert not led.end.command(stop, led.now).any()


def assert_brakes(led):
    """To zero in time, within its accelerations, and not again."""
    silent = np.array(led.told)
    assert (silent[5] == MOVING).all()
    assert not silent[round((FRESH_S + TOLD_ZERO_S) / PERIOD_S) :].any()
    changes = np.linalg.norm(np.diff(silent[:, :3], axis=0), axis=1)
    assert changes.max() <= DRIVE.acceleration * PERIOD_S * 1.001


def test_a_base_that_is_not_heard_is_told_to_stand_still(led):
    led.speaks = False
    led.ticks(1.0, MOVING)
    assert_brakes(led)
    led.speaks = True
    led.ticks(0.5, MOVING)
    assert led.state == FollowerState.REFUSING
    assert not np.any(led.told)


def test_one_whose_odometry_falls_silent_soon_is_none_that_is_heard(led):
    led.has_odometry = False
    led.ticks(1.0, MOVING)
    assert 0 < PERIOD_S * len(led.samples) <= ODOMETRY_LASTS_S
    silent_s = ODOMETRY_LASTS_S + FRESH_S + TOLD_ZERO_S
    assert not np.any(led.told[round(silent_s / PERIOD_S) :])


def test_without_odometry_it_is_taken_to_move_as_the_simulated_one_does():
    led = Led(has_odometry=False)
    led.ticks(0.7)
    plant = TwistPlant(DRIVE, TWISTER.plant.imu, np.random.default_rng(0))
    for twist in (MOVING, 0.1 * MOVING, -MOVING):
        led.ticks(0.3, twist)
        for told, sample in zip(led.told, led.samples, strict=True):
            within = DRIVE.acceleration * PERIOD_S  # a tick, at its hardest
            assert sample.twist_in_b == pytest.approx(plant.twist_in_b, abs=within)
            plant.step(told, PERIOD_S)
        assert sample.twist_in_b == pytest.approx(twist, abs=1e-3)


def test_samples_that_are_late_carry_no_command(led):
    led.late = 0.1
    led.ticks(0.5, MOVING)
    assert_brakes(led)


def test_a_clock_that_goes_otherwise_than_ours_makes_no_sample_late(led):
    for _ in range(50):
        led.stamp_ahead -= 0.001  # 50 ms in all: late, to who believes the first samples for ever
        led.ticks(0.5, MOVING)
        assert led.state == FollowerState.RUNNING
        assert np.array_equal(led.told[-1], MOVING)


def test_samples_have_the_base_s_time_axes_and_motion(led):
    turned = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    led = Led(turned).ticks(0.2)
    led.now += PERIOD_S
    led.odometry((0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    sample = led.imu(a_in_i=(9.8, 0.0, 0.1))
    assert sample.t_us == round(1e6 * (led.now + led.stamp_ahead))
    assert sample.omega_in_b == pytest.approx([0.3, 0.1, 0.2])
    assert sample.a_in_b == pytest.approx([0.1, 9.8, 0.0])
    assert sample.twist_in_b == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert sample.thrusts.shape == (0,)


NOT_BELIEVED = {
    "not a number": {"omega_in_i": (np.nan, 0.0, 0.0)},
    "infinite": {"a_in_i": (0.0, -np.inf, 0.0)},
    "beyond what is measured": {"omega_in_i": (0.0, 1e300, 0.0)},
    "without a gyroscope or accelerometer": {"measures_both": False},
    "not dated": {"stamp_us": 0},
    "before 1970": {"stamp_us": -5},
    "of somebody else": {"writer": STRANGER},
}


@pytest.mark.parametrize("why", NOT_BELIEVED)
def test_what_can_not_be_is_dropped_counted_and_carries_no_command(why):
    led = Led().ticks(0.7)
    dropped = led.end.dropped
    led.now += PERIOD_S
    assert led.imu(**NOT_BELIEVED[why]) is None
    assert led.end.dropped == dropped + 1
    led.ticks(0.2, MOVING)
    assert led.state == FollowerState.RUNNING


def test_what_is_repeated_or_overtaken_is_dropped(led):
    dropped = led.end.dropped
    assert led.imu() is None
    led.late = 0.012
    assert led.imu() is None
    assert led.end.dropped == dropped + 2


@pytest.mark.parametrize("twist", [(np.nan, *5 * (0.0,)), (0.0, 1e9, *4 * (0.0,))])
def test_odometry_that_can_not_be_is_dropped_and_its_writer_does_not_count(twist):
    led = Led()
    assert led.odometry(twist, STRANGER) is None
    assert led.end.dropped == 1
    led.ticks(0.7).ticks(0.2, MOVING)
    assert led.state == FollowerState.RUNNING


def test_a_stranger_takes_the_place_of_none_who_speaks_and_says_nothing_of_its_motion(led):
    for _ in range(400):
        led.ticks(PERIOD_S, MOVING)
        led.odometry((0.4, *5 * (0.0,)), STRANGER)
        assert led.imu(writer=STRANGER, omega_in_i=(3.0, 0.0, 0.0)) is None
        assert (led.samples[-1].twist_in_b == 0.0).all()
    assert led.state == FollowerState.RUNNING
    assert led.end.dropped >= 800


def restarts(led):
    """Begins anew, and takes nothing but half a second of zero."""
    boot_id = led.samples[-1].boot_id if led.samples else None
    led.ticks(0.5, MOVING)
    assert led.samples[-1].boot_id != boot_id
    assert (led.state, led.samples[-1].refusal) == (FollowerState.REFUSING, Refusal.ZERO_FIRST)
    assert not np.any(led.told)
    led.ticks(0.7).ticks(0.2, MOVING)
    assert led.state == FollowerState.RUNNING


def test_a_driver_that_has_restarted_begins_anew_once_the_old_one_has_been_silent(led):
    led.writer = BASE + 1
    led.ticks(KEEPS_WRITER_S - 0.01, MOVING)
    assert led.samples == []
    restarts(led)


@pytest.mark.parametrize("by", [-100.0, -1.5, 1.5, 1e6])
def test_a_clock_that_is_set_begins_anew(led, by):
    led.stamp_ahead += by
    restarts(led)


@pytest.mark.parametrize("by", [-0.13, -0.3, -0.9])
def test_a_clock_that_is_set_back_a_little_begins_anew_once_it_says_something_new(led, by):
    """As by ntpd, from 0.128 s on: dated by the time before, all would be late."""
    boot_id = led.samples[-1].boot_id
    led.stamp_ahead += by
    led.ticks(0.05 - by, MOVING)
    assert led.samples[-1].boot_id != boot_id
    led.ticks(0.7).ticks(0.2, MOVING)
    assert led.state == FollowerState.RUNNING


def test_what_comes_again_by_a_slower_way_sets_no_clock(led):
    boot_id = led.samples[-1].boot_id
    for _ in range(100):
        led.ticks(PERIOD_S, MOVING)
        led.late = 0.2
        assert led.imu() is None
        led.late = 0.0
    assert (led.state, led.samples[-1].boot_id) == (FollowerState.RUNNING, boot_id)


def test_a_pause_of_the_network_sets_no_clock(led):
    boot_id = led.samples[-1].boot_id
    led.now += 3.0  # all is lost
    led.ticks(0.1)
    assert led.samples[-1].boot_id == boot_id
    led.now += 3.0
    for k in range(600):  # all at once
        led.late = 3.0 - PERIOD_S * k
        led.imu()
    led.late = 0.0
    led.ticks(0.1)
    assert led.samples[-1].boot_id == boot_id


def test_each_process_and_each_start_has_another_boot_id():
    ids = {Led().ticks(0.1).samples[-1].boot_id for _ in range(20)}
    assert len(ids) == 20


def told(**motion):
    table = robot_table(robot_path("twister"))
    del table["body_imu"]
    return robot_of(table | {"motion": {"stands_level": False} | motion}, "told")


class LedWithoutSensors:
    """Its odometry comes ten times a second, if at all."""

    def __init__(self, robot_file):
        self.motion = robot_file.robot.motion
        measures = self.motion.is_measured
        self.end, self.now = BaseEnd(robot_file, 1, STRAIGHT, has_odometry=measures), 10.0
        self.speaks, self.stamp_ahead = self.motion.is_measured, 1000.0

    def ticks(self, seconds, twist_in_b=(0.0,) * 6):
        told, samples, twist = [], [], np.array(twist_in_b)
        for _ in range(round(seconds / PERIOD_S)):
            self.now += PERIOD_S
            if self.speaks and round(self.now / PERIOD_S) % 20 == 0:
                stamp_us = round(1e6 * (self.now - 0.02 + self.stamp_ahead))
                said = HeardOdometry(BASE, tuple(0.5 * MOVING), stamp_us)
                assert self.end.hear(said, self.now) is None
            if (sample := self.end.beat(self.now)) is not None:
                samples.append(sample)
            command = TwistCommand(twist, armed=bool(twist.any()))
            told.append(self.end.command(command, self.now))
        return told, samples


def test_a_base_without_motion_sensors_is_led_by_its_odometry_and_told_to_stand_without():
    led = LedWithoutSensors(told(twist="measured", rate_hz=10.0))
    led.ticks(0.8)
    moved, samples = led.ticks(0.5, MOVING)
    assert (moved[-1] == MOVING).all()
    assert samples[-1].state == FollowerState.RUNNING
    assert samples[-1].twist_in_b == pytest.approx(0.5 * MOVING)
    assert min(s.twist_age_s for s in samples) >= 0.0
    assert max(s.twist_age_s for s in samples) < 0.125
    led.speaks = False
    silent, _ = led.ticks(1.0, MOVING)
    bound = led.motion.lasts_s + FRESH_S + TOLD_ZERO_S
    assert not np.any(silent[round(bound / PERIOD_S) :])


def test_no_twist_is_older_than_it_is_because_a_clock_was_set_back():
    led = LedWithoutSensors(told(twist="measured", rate_hz=10.0))
    led.ticks(0.8)
    led.stamp_ahead -= 0.25
    led.ticks(0.5)
    _, samples = led.ticks(1.0)
    assert max(s.twist_age_s for s in samples) < 0.125


def test_a_base_that_says_nothing_is_led_by_what_it_was_told():
    led = LedWithoutSensors(told(twist="commanded"))
    led.ticks(0.7)
    moved, samples = led.ticks(0.5, MOVING)
    assert (moved[-1] == MOVING).all()
    assert samples[-1].twist_in_b == pytest.approx(MOVING)
    assert {s.twist_age_s for s in samples} == {NOT_MEASURED}


def test_one_with_motion_sensors_says_nothing_without_them(led):
    assert led.end.beat(led.now) is None
