"""How much of a hand's trembling pictures of a glass hide: none, a share, or all of it."""

import numpy as np
import pytest

from pipeline.frames import GRAVITY, exp
from pipeline.glass.turn_meter import TurnMeter
from pipeline.signals import PhoneImu, RelativePose

BIAS = np.radians([0.3, -0.2, 0.4])
MIDDLE_IN_F = np.array([0.6, 0.0, 0.0])


def attitude(t, deg):
    """Of a phone in a hand that sways slowly and trembles at 9 Hz."""
    tremor = np.radians(deg) * np.sin(2.0 * np.pi * 9.0 * t)
    sway = np.radians(2.0) * np.sin(2.0 * np.pi * 0.3 * t)
    return exp(np.array([0.0, 0.5 * tremor, sway + tremor]))


def watched(hidden, deg=0.15, seconds=20.0, late_s=0.0, lever_m=0.0):
    """A meter after so many seconds, of pictures that hide this share of the trembling."""
    meter, rng = TurnMeter(), np.random.default_rng(3)
    for k in range(int(100 * seconds)):
        t = k / 100.0
        step = attitude(t - 1e-4, deg).T @ attitude(t + 1e-4, deg)
        omega = np.array([step[2, 1], step[0, 2], step[1, 0]]) / 2e-4 + BIAS
        meter.add_phone_imu(PhoneImu(t, omega, np.array([0.0, 0.0, GRAVITY])))
        if k % 3 == 0 and k > 30:
            seen_t = t - 0.1
            R = attitude(seen_t - late_s, (1.0 - hidden) * deg)
            at = R.T @ (MIDDLE_IN_F - R @ np.array([lever_m, 0.0, 0.0]))
            at = at + 3e-5 * rng.normal(size=3)
            meter.add_pose(RelativePose(seen_t, at, R.T, np.eye(6), 0.1, 16))
    return meter.held()


@pytest.mark.parametrize("hidden", [0.0, 0.4, 0.8, 1.0])
def test_the_share_that_is_hidden_is_found_whatever_bias_the_gyroscope_has(hidden):
    assert watched(hidden).value == pytest.approx(hidden, abs=0.08)


@pytest.mark.parametrize("late_s", [-0.02, 0.01, 0.03])
def test_pictures_that_are_dated_wrongly_hide_nothing_by_that(late_s):
    assert abs(watched(0.0, late_s=late_s).value) < 0.08


@pytest.mark.parametrize("lever_m", [-0.1, 0.1])
def test_a_phone_that_turns_about_a_wrist_is_within_the_doubt(lever_m):
    found = watched(0.0, lever_m=lever_m)
    assert 0.05 < abs(found.value) < 2.0 * found.sigma


def test_a_phone_that_hardly_trembles_or_not_for_long_tells_nothing():
    assert watched(0.0, deg=0.01) is None
    assert watched(0.0, seconds=1.5) is None
