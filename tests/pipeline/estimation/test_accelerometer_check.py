"""An accelerometer that is turned round or falls is told from every hand and every bias."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.accelerometer_check import AccelerometerCheck
from pipeline.frames import GRAVITY, Array, exp

UP = np.array([0.0, 0.0, GRAVITY])
H = 0.01


def felt(seconds: float, then: Array, then_s: float) -> tuple[AccelerometerCheck, float]:
    """Turn for a while, then feel gravity by the map `then` (3, 3); when it jumped [s], or inf."""
    check, R, omega = AccelerometerCheck(), np.eye(3), np.array([0.4, -0.3, 0.9])
    for k in range(round((seconds + then_s) / H)):
        told = R.T @ UP if k * H < seconds else then @ R.T @ UP
        check.add(k * H, omega, told)
        if check.has_jumped:
            return check, k * H - seconds
        R = R @ exp(H * omega)
    return check, np.inf


@pytest.mark.parametrize(
    "then",
    [
        -np.eye(3),
        np.zeros((3, 3)),
        np.eye(3)[[1, 2, 0]],
        np.diag([1.0, -1.0, -1.0]),
        2.0 * np.eye(3),
    ],
    ids=["turned", "falls", "axes", "half_turned", "twice"],
)
def test_gravity_that_jumps_is_noticed_in_time(then: Array) -> None:
    _, noticed_s = felt(20.0, then, 1.0)
    assert 0.0 < noticed_s < 0.4


def test_a_sign_that_turns_is_noticed_within_an_eighth_of_a_second() -> None:
    assert felt(20.0, -np.eye(3), 1.0)[1] < 0.125


def test_who_turns_on_and_on_has_not_jumped_nor_one_with_a_bias() -> None:
    assert felt(60.0, np.eye(3), 0.0)[1] == np.inf
    check, bias = AccelerometerCheck(), np.array([1.0, 0.0, 0.0])
    for k in range(2000):
        check.add(k * H, np.full(3, 0.02), UP + (k > 1000) * bias)
        assert not check.has_jumped


@pytest.mark.parametrize("hz", [2.0, 4.0, 6.0])
def test_shaken_to_a_full_scale_of_two_g_it_has_not_jumped(hz: float) -> None:
    check = AccelerometerCheck()
    for k in range(1000):
        shake = 1.2 * GRAVITY * np.sin(2.0 * np.pi * hz * k * H) * np.array([0.6, 0.0, 0.8])
        check.add(k * H, np.zeros(3), np.clip(UP + shake, -2.0 * GRAVITY, 2.0 * GRAVITY))
        assert not check.has_jumped


def test_after_a_gap_it_begins_anew_and_says_nothing_at_first() -> None:
    check, _ = felt(4.0, np.eye(3), 0.0)
    for k in range(400):
        check.add(5.0 + k * H, np.zeros(3), -UP)
        assert not check.has_jumped


def test_samples_that_are_no_numbers_or_older_are_none() -> None:
    check, _ = felt(4.0, np.eye(3), 0.0)
    for k in range(100):
        check.add(4.0 + k * H, np.zeros(3), np.full(3, np.nan))
        check.add(1.0 + k * H, np.zeros(3), -UP)
    assert not check.has_jumped
