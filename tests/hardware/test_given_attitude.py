"""What a silence makes of a lean and a thrust."""

import numpy as np
import pytest

from hardware.given_attitude import GivenAttitude
from hardware.given_thrusts import TO_MEAN_US
from pipeline.robot import AttitudeDrive

DRIVE = AttitudeDrive(max_tilt=0.3, yaw_rate=1.0, lag_s=0.15, delay_s=0.02, yaw_lag_s=0.1)
RAMP_US, TICK_US = 2_000_000, 5_000
LEADS = np.array([0.2, -0.1, 0.5, 12.0])


def given_after(*commands):
    given = GivenAttitude(DRIVE, 28.0, 8.0, RAMP_US)
    for k, told in enumerate(commands):
        given.follow(np.array(told), k * TICK_US)
    return given, len(commands) * TICK_US


def test_it_gives_what_it_is_told():
    given, now_us = given_after(LEADS)
    np.testing.assert_array_equal(given.at(now_us), LEADS)
    assert given


def test_silence_is_level_and_straight_within_a_tenth_of_a_second_and_the_thrust_fades_slowly():
    given, now_us = given_after(*[LEADS] * 3)
    given.fading.begin(now_us)
    half = given.at(now_us + TO_MEAN_US // 2)
    np.testing.assert_allclose(half[:3], 0.5 * LEADS[:3])
    late = given.at(now_us + TO_MEAN_US)
    np.testing.assert_array_equal(late[:3], np.zeros(3))
    assert late[3] == pytest.approx((1.0 - TO_MEAN_US / RAMP_US) * 12.0)
    assert not given.fading.is_over(now_us + RAMP_US - 1)
    assert given.fading.is_over(now_us + RAMP_US)
    np.testing.assert_array_equal(given.at(now_us + RAMP_US), np.zeros(4))


def test_a_second_silence_begins_no_new_one_and_a_command_ends_it():
    given, now_us = given_after(LEADS)
    given.fading.begin(now_us)
    given.fading.begin(now_us + TO_MEAN_US)
    assert not given.at(now_us + TO_MEAN_US)[:3].any()
    given.follow(LEADS, now_us + TO_MEAN_US)
    np.testing.assert_array_equal(given.at(now_us + 2 * TO_MEAN_US), LEADS)


def test_after_a_silence_the_thrust_goes_back_by_the_rise_that_is_allowed():
    given, now_us = given_after(*[(0.0, 0.0, 0.0, 20.0)] * 3)
    given.fading.begin(now_us)
    faded = given.at(now_us + RAMP_US - 1)[3]
    given.follow(np.array([0.0, 0.0, 0.0, 20.0]), now_us + RAMP_US - 1)
    assert given.at(now_us + RAMP_US)[3] == pytest.approx(faded + 8.0)


@pytest.mark.parametrize(
    ("told", "beyond"),
    [
        ((0.2, 0.2, 0.9, 28.0), False),
        ((0.22, 0.22, 0.0, 5.0), True),
        ((0.0, 0.0, -1.1, 5.0), True),
        ((0.0, 0.0, 0.0, 28.1), True),
        ((0.0, 0.0, 0.0, -0.1), True),
    ],
)
def test_what_is_more_than_its_file_allows(told, beyond):
    assert given_after()[0].is_beyond(np.array(told)) == beyond


def test_only_the_thrust_may_be_too_steep():
    given, _ = given_after((0.0, 0.0, 0.0, 4.0))
    assert not given.is_too_steep(np.array([0.3, 0.0, 1.0, 12.0]), 1)
    assert given.is_too_steep(np.array([0.0, 0.0, 0.0, 12.1]), 1)
    assert not given.is_too_steep(np.array([0.0, 0.0, 0.0, 12.1]), 2)


def test_zero_is_at_once():
    given, now_us = given_after(LEADS)
    given.zero()
    assert not given.at(now_us).any()
    assert not given
