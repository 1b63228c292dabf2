"""What a silence makes of a thrust that was changing fast."""

import numpy as np
import pytest

from hardware.given_thrusts import MEAN_OF, TO_MEAN_US, GivenThrusts

RAMP_US, TICK_US = 2_000_000, 5_000
SWINGING = [(2.8, 1.0) if k // 10 % 2 else (0.2, 1.0) for k in range(MEAN_OF)]


def given_after(*commands):
    given = GivenThrusts(2, 3.0, 1.0, RAMP_US, None)
    for k, thrusts in enumerate(commands):
        given.follow(np.array(thrusts), k * TICK_US)
    return given, len(commands) * TICK_US


@pytest.mark.parametrize("before", [[], [(3.0, 0.1)] * 500], ids=["just begun", "long ago"])
def test_silence_goes_over_to_the_mean_of_what_was_given_lately(before):
    """The last command damps a motion that ends meanwhile; held for long it begins another."""
    given, now_us = given_after((0.0, 0.0), *before, *SWINGING)
    np.testing.assert_array_equal(given.at(now_us), SWINGING[-1])
    given.fading.begin(now_us)
    np.testing.assert_allclose(given.at(now_us), SWINGING[-1], atol=1e-12)
    weights = np.ones(MEAN_OF)
    if before:  # all the same there, so one stands for all
        kept = (1.0 - 1.0 / MEAN_OF) ** np.arange(MEAN_OF + 1)
        weights = np.append(kept[MEAN_OF], kept[MEAN_OF - 1 :: -1] / MEAN_OF)
    mean = np.average([*before[-1:], *SWINGING], axis=0, weights=weights)
    for since_us in (TO_MEAN_US, TO_MEAN_US + 200_000):
        share = 1.0 - since_us / RAMP_US
        np.testing.assert_allclose(given.at(now_us + since_us), share * mean)


def test_a_steady_thrust_is_its_own_mean_from_the_first_command_on():
    given, now_us = given_after((0.0, 0.0), *[(2.0, 0.5)] * 3)
    given.fading.begin(now_us)
    np.testing.assert_array_equal(given.at(now_us + RAMP_US // 2), [1.0, 0.25])


@pytest.mark.parametrize("stop", [lambda g: g.zero(), lambda g: g.follow(np.zeros(2), 10**7)])
def test_nothing_is_given_in_silence_after_zero_whatever_was_before(stop):
    given, _ = given_after(*SWINGING)
    stop(given)
    assert not given
    given.fading.begin(10**7)
    for since_us in range(0, RAMP_US, 50_000):
        assert not given.at(10**7 + since_us).any()


def test_no_thruster_is_given_more_than_it_was_since_the_mean_began():
    rng = np.random.default_rng(1)
    commands = rng.uniform(0.0, 3.0, (400, 2))
    given, now_us = given_after(*commands)
    given.fading.begin(now_us)
    for since_us in range(0, RAMP_US, 1_000):
        now = given.at(now_us + since_us)
        assert (now >= 0.0).all()
        assert (now <= commands.max(axis=0)).all()
