"""A picture with a new time is news only if it shows something new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.repeated_picture import RepeatedPicture
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from tests.pipeline.seeing import rays_at

P, LEVEL = np.array([2.5, 0.0, 0.0]), np.eye(3)
TURNING = np.array([0.0, 0.0, 0.4])  # of a tremor's rate
NOISE_RAD_S = 0.005


def seen(t: float, leds: list[int] | None = None) -> VisionMeasurement:
    return VisionMeasurement(t, rays_at(t, P, LEVEL, leds), None)


def add_shaking(repeated: RepeatedPicture, side: type[PhoneImu] | type[BodyImu], omega: np.ndarray):
    for t in np.arange(-0.3, 0.03, 0.01):
        repeated.add_imu(side(t, np.sin(30.0 * t) * omega, np.zeros(3)))


@pytest.mark.parametrize("side", [PhoneImu, BodyImu])
def test_a_picture_that_stays_while_either_side_turns_is_no_news(side) -> None:
    repeated = RepeatedPicture()
    assert not repeated.comes_again(seen(0.0))
    add_shaking(repeated, side, TURNING)
    assert repeated.comes_again(seen(0.03))
    assert repeated.comes_again(seen(0.06))


@pytest.mark.parametrize("number", [(0, 0), (4, 1)])
def test_the_last_bit_of_one_place_makes_it_news(number) -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    add_shaking(repeated, PhoneImu, TURNING)
    rays = rays_at(0.03, P, LEVEL)
    tangents = rays.tangents.copy()
    tangents[number] = np.nextafter(tangents[number], np.inf)
    assert not repeated.comes_again(VisionMeasurement(0.03, replace(rays, tangents=tangents), None))


def test_other_leds_and_none_at_all_are_news() -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    add_shaking(repeated, PhoneImu, TURNING)
    assert not repeated.comes_again(seen(0.03, [0, 1, 2, 3]))
    assert not repeated.comes_again(seen(0.06, []))
    assert not repeated.comes_again(seen(0.09, []))


def test_where_nothing_turns_nothing_need_change() -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    add_shaking(repeated, PhoneImu, np.zeros(3))
    assert not repeated.comes_again(seen(0.03))


@pytest.mark.parametrize(("side", "rate_hz"), [(PhoneImu, 60.0), (BodyImu, 200.0)])
def test_noise_and_bias_of_a_minute_at_rest_turn_nothing(side, rate_hz) -> None:
    rng, repeated, taken = np.random.default_rng(1000), RepeatedPicture(), 0
    for k in range(int(60.0 * rate_hz)):
        omega = np.array([0.02, 0.0, -0.01]) + rng.normal(0.0, NOISE_RAD_S, 3)
        repeated.add_imu(side(k / rate_hz, omega, np.zeros(3)))
        taken += not repeated.comes_again(seen(k / rate_hz))
    assert taken == int(60.0 * rate_hz)


def test_what_turned_since_a_picture_came_stays_turned() -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    add_shaking(repeated, BodyImu, TURNING)
    for t in np.arange(0.03, 2.0, 0.01):
        repeated.add_imu(BodyImu(t, np.zeros(3), np.zeros(3)))
    assert repeated.comes_again(seen(2.0))


def test_what_rested_when_a_picture_came_may_have_turned_before() -> None:
    repeated = RepeatedPicture()
    add_shaking(repeated, PhoneImu, TURNING)
    repeated.comes_again(seen(0.0))
    for t in np.arange(0.03, 0.5, 0.01):
        repeated.add_imu(PhoneImu(t, np.zeros(3), np.zeros(3)))
    assert not repeated.comes_again(seen(0.5))
