"""A picture with a new time is news only if it shows something new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.repeated_picture import RepeatedPicture
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from tests.pipeline.seeing import rays_at

P, LEVEL = np.array([2.5, 0.0, 0.0]), np.eye(3)
TURNING = np.array([0.0, 0.0, 0.02])  # more with each sample


def seen(t: float, leds: list[int] | None = None) -> VisionMeasurement:
    return VisionMeasurement(t, rays_at(t, P, LEVEL, leds), None)


def felt(repeated: RepeatedPicture, side: type[PhoneImu] | type[BodyImu], omega: np.ndarray):
    for k, t in enumerate((0.0, 0.02, 0.04)):
        repeated.add_imu(side(t, k * omega, np.zeros(3)))


@pytest.mark.parametrize("side", [PhoneImu, BodyImu])
def test_a_picture_that_stays_while_either_side_turns_is_no_news(side) -> None:
    repeated = RepeatedPicture()
    assert not repeated.comes_again(seen(0.0))
    felt(repeated, side, TURNING)
    assert repeated.comes_again(seen(0.03))
    assert repeated.comes_again(seen(0.06))


@pytest.mark.parametrize("number", [(0, 0), (4, 1)])
def test_the_last_bit_of_one_place_makes_it_news(number) -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    felt(repeated, PhoneImu, TURNING)
    rays = rays_at(0.03, P, LEVEL)
    tangents = rays.tangents.copy()
    tangents[number] = np.nextafter(tangents[number], np.inf)
    assert not repeated.comes_again(VisionMeasurement(0.03, replace(rays, tangents=tangents), None))


def test_other_leds_and_none_at_all_are_news() -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    felt(repeated, PhoneImu, TURNING)
    assert not repeated.comes_again(seen(0.03, [0, 1, 2, 3]))
    assert not repeated.comes_again(seen(0.06, []))
    assert not repeated.comes_again(seen(0.09, []))


def test_where_nothing_turns_nothing_need_change() -> None:
    repeated = RepeatedPicture()
    repeated.comes_again(seen(0.0))
    felt(repeated, PhoneImu, np.zeros(3))
    assert not repeated.comes_again(seen(0.03))
