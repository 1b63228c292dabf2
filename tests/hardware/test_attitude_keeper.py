"""How a flying robot keeps upright alone: thrusts it can give, whatever it measures."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.attitude_keeper import AttitudeGains, AttitudeKeeper
from hardware.link.robot_end import LinkLimits, RobotEnd
from hardware.robot_file import load_robot
from pipeline.config import HoldConfig

GAINS = AttitudeGains.of(load_robot("quadrotor").robot, HoldConfig())
UPRIGHT = np.array([0.0, 0.0, 9.81])
STILL = np.zeros(3)
KEY = bytes(range(16))

words = st.floats(width=32)


def asymmetric(seed):
    """Gains of a body whose rotors are anyhow, and thrusts within their limits."""
    random = np.random.default_rng(seed)
    thrusters = int(random.integers(1, 9))
    gains = AttitudeGains(
        lift_row=random.uniform(-0.5, 1.0, thrusters),
        lift_column=random.uniform(-0.5, 1.0, thrusters),
        gain=random.normal(size=(thrusters, 6)) * 10.0 ** random.uniform(-3.0, 3.0),
        f_max=3.0,
    )
    return gains, random.uniform(0.0, gains.f_max, thrusters), random


def turned(gains, random):
    """A keeper of these gains, tilted and turning."""
    keeper = AttitudeKeeper(gains)
    keeper.add_imu(random.normal(size=3), UPRIGHT, 0.05, at_rest=False)
    return keeper


def level_and_torque(gains, keeper, falling):
    level = np.clip(gains.lift_column * max(0.0, gains.lift_row @ falling), 0.0, gains.f_max)
    state = np.concatenate((np.cross([0.0, 0.0, 1.0], keeper.up_in_b), keeper._omega_in_b))
    return level, gains.gain @ state


@settings(max_examples=200)
@given(st.integers(0, 2**32))
def test_thrusts_are_within_limits_and_no_torque_turns_round_whatever_the_rotors(seed):
    gains, falling, random = asymmetric(seed)
    keeper = turned(gains, random)
    thrusts = keeper.thrusts(falling)
    assert ((thrusts >= 0.0) & (thrusts <= gains.f_max)).all()
    level, torque = level_and_torque(gains, keeper, falling)
    assert ((thrusts - level) * np.sign(torque) >= -1e-12).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("at_rest", [False, True])
def test_a_sample_that_is_no_number_is_as_if_it_had_not_come(bad, axis, at_rest):
    keeper, other = AttitudeKeeper(GAINS), AttitudeKeeper(GAINS)
    sample = np.concatenate(([0.01, 0.02, 0.03], UPRIGHT))
    spoilt = sample.copy()
    spoilt[axis] = bad
    for k in (keeper, other):
        k.add_imu(sample[:3], sample[3:], 0.005, at_rest)
    keeper.add_imu(spoilt[:3], spoilt[3:], 0.005, at_rest)
    for k in (keeper, other):
        k.add_imu(sample[:3], sample[3:], 0.005, at_rest)
    falling = np.full(4, 0.5)
    np.testing.assert_array_equal(keeper.thrusts(falling), other.thrusts(falling))


@settings(max_examples=100)
@given(st.lists(st.tuples(st.lists(words, min_size=6, max_size=6), st.booleans()), max_size=20))
def test_thrusts_are_finite_and_within_limits_whatever_is_measured(samples):
    keeper = AttitudeKeeper(GAINS)
    for values, at_rest in samples:
        keeper.add_imu(np.array(values[:3]), np.array(values[3:]), 0.05, at_rest)
        thrusts = keeper.thrusts(np.full(4, 0.5))
        assert ((thrusts >= 0.0) & (thrusts <= GAINS.f_max)).all()


def test_a_clock_that_steps_back_does_not_turn_the_vertical_back():
    limits = replace(LinkLimits.of(load_robot("quadrotor")), attitude=GAINS)
    end, omega = RobotEnd(limits, 1, KEY), (1.0, 0.0, 0.0)
    end.sample(10_000_000, 1, omega, tuple(UPRIGHT), np.zeros(4))
    before = end._keeper.up_in_b
    end.sample(1_000_000, 2, omega, tuple(UPRIGHT), np.zeros(4))
    np.testing.assert_allclose(end._keeper.up_in_b, before, atol=1e-12)
