"""A robot that takes a twist, led by a phone in virtual time: how well, how fast, and when not."""

from collections import deque
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from hardware.link.datagram import decode_command, encode_command
from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.hand import make_hand
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.virtual_time_follower import KEY
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.signals import Mode
from server.experiments.forked import forked
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

TWISTER = load_robot("twister", takes=COMMANDS)
DRIVE = TWISTER.robot.twist
STANDS_M_S = 0.002
SEED = 1012
"""Kept apart: no number was chosen with it."""

pytestmark = pytest.mark.slow


class Flight:
    def __init__(self, robot_file, hand="filming", seed=SEED):
        scene = SimulationOptions(hand=hand, seed=seed, led_noise_px=0.1, gains="phone")
        self.loop = VirtualTimeSimulation(robot_file, TeleopConfig(), scene)
        self.told, self.done, self.modes = [], [], []

    def fly(self, seconds):
        until = self.loop.t + seconds - 1e-9
        while self.loop.t < until:
            output = self.loop.advance()
            self.told.append(output.twist_in_b)
            self.done.append(self.loop.follower.body.given)
            self.modes.append(output.failsafe.mode)
        return self


@pytest.fixture(scope="module")
def flight():
    return Flight(TWISTER).fly(8.0)


def rms(rows):
    return float(np.sqrt((np.array(rows) ** 2).sum(axis=1).mean()))


def test_it_follows_a_hand_by_pictures_of_60_to_120_ms(flight):
    trace = flight.loop.trace
    assert len(trace.t) > 1000
    assert rms(trace.error_in_f) < 0.010
    assert rms(trace.turn) < np.radians(2.0)
    assert np.linalg.norm(flight.done, axis=1).max() > 0.05  # and the hand did move


def assert_within(drive, flight):
    assert not any(drive.exceeds(twist, 1.000001) for twist in (*flight.told, *flight.done))
    changes = np.diff(flight.told, axis=0)
    assert np.linalg.norm(changes[:, :3], axis=1).max() <= drive.acceleration * PERIOD_S * 1.0001
    most = drive.angular_acceleration * PERIOD_S * 1.0001
    assert np.linalg.norm(changes[:, 3:], axis=1).max() <= most


def test_it_stays_within_its_limits_even_where_the_hand_is_faster(flight):
    assert_within(DRIVE, flight)
    slow = replace(DRIVE, speed=0.02, acceleration=0.2, rate=0.02, angular_acceleration=0.2)
    tired = Flight(replace(TWISTER, robot=replace(TWISTER.robot, twist=slow))).fly(6.0)
    assert_within(slow, tired)
    assert np.linalg.norm(np.array(tired.done)[:, :3], axis=1).max() > 0.019


def last(happens, flight, before):
    """Since `before` [s], until it happens no more."""
    since = [k for k, row in enumerate(flight) if happens(row)]
    return PERIOD_S * (since[-1] + 1) if since else before


def vanish(flight):
    flight.loop.lost = {"motion", "picture", "touch"}
    flight.told, flight.done, flight.modes = [], [], []
    flight.fly(1.0)
    moves = last(lambda twist: np.linalg.norm(twist[:3]) > STANDS_M_S, flight.done, 0.0)
    return last(np.any, flight.told, 0.0), moves, bool(np.any(flight.told[60:]))


def test_it_stands_a_fifth_of_a_second_after_the_phone_has_vanished(flight):
    for _ in range(8):
        flight.fly(0.115)
        told_s, moves_s, again = forked(partial(vanish, flight))
        assert told_s <= 0.17
        assert moves_s <= 0.20
        assert not again


def let_go(flight):
    flight.loop._script.operator.leaving = True
    flight.told, flight.done, flight.modes = [], [], []
    flight.fly(4.5)
    held = flight.modes.index(Mode.HOLD)
    fading = flight.told[held : held + round(DRIVE.stop_s / PERIOD_S)]
    return np.linalg.norm(fading, axis=1), flight.told[held + len(fading) :], flight.modes[-1]


def test_let_go_it_brakes_holds_at_zero_and_disarms(flight):
    fading, after, mode = forked(partial(let_go, flight))
    assert (np.diff(fading) <= 0.0).all()
    assert not np.any(after)
    assert mode == Mode.DISARMED


class Line:
    """Between control and robot: what comes out in place of a command."""

    def __init__(self, kind):
        self.kind, self.kept = kind, deque()

    def __call__(self, data):
        self.kept.append(data)
        if self.kind == "late":
            return [self.kept.popleft()] if len(self.kept) > 20 else []
        if self.kind == "replayed":
            return [self.kept[0]]
        if self.kind == "forged":
            return [data[:40] + bytes([data[40] ^ 1]) + data[41:]]
        command = decode_command(data, KEY)
        return [encode_command(replace(command, twist_in_b=(np.nan, *5 * (0.1,))), KEY)]


def tampered(flight, kind):
    line = Line(kind)
    flight.loop.follower.to_robot = line
    flight.done = []
    flight.fly(0.30)
    p_bf_in_f = flight.loop.follower.body.p_bf_in_f
    flight.fly(0.7)
    way = flight.loop.follower.body.p_bf_in_f - p_bf_in_f
    return float(np.linalg.norm(way)), np.linalg.norm(flight.done[-100:], axis=1).max()


@pytest.mark.parametrize("kind", ["late", "replayed", "forged", "nan"])
def test_commands_that_are_not_to_be_believed_move_nothing(flight, kind):
    way_m, moves = forked(partial(tampered, flight, kind))
    assert way_m < 0.0005
    assert moves < 1e-4


@pytest.mark.parametrize("seed", [1000, 1001])
def test_an_arm_whose_twist_is_older_than_it_says_is_led_by_a_hand_that_rests_first(seed):
    """What that seems to say of the pictures' time is not believed: it held, and came down."""
    arm = load_robot("so101", takes=COMMANDS)
    hand = make_hand("filming", seed=seed, start=arm.start, rest_s=8.0)
    scene = SimulationOptions(hand="filming", seed=seed, frame_rate_hz=15.0)
    late = PlantOptions(twist_late_s=0.02)
    loop = VirtualTimeSimulation(arm, TeleopConfig(), scene, hand=hand, plant=late)
    modes, offsets_s = set(), []
    while loop.t < 12.0:
        modes.add(loop.advance().failsafe.mode)
        offsets_s.append(loop.controller.teleop.estimator.health.time_offset)
    assert modes == {Mode.DISARMED, Mode.ARMED, Mode.TRACK}
    assert np.nanmax(np.abs(offsets_s)) < 0.02
    assert rms(loop.trace.error_in_f) < 0.010
