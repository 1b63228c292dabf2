"""Jumps that are missing from a picture are told from jumps that are elsewhere, and from noise."""

import numpy as np
import pytest

from pipeline.vision.steadied_picture import SteadiedPicture

NOISE_M2 = 1e-7
JUMPS = 0.003 * np.random.default_rng(1).normal(size=(90, 2))


def watched(seen, predicted, variance=NOISE_M2, dates=None):
    jumps = SteadiedPicture()
    dates = np.arange(len(seen)) / 30.0 if dates is None else dates
    for n, (row, there) in enumerate(zip(seen, predicted, strict=True)):
        jumps.add(dates[n], dates[n - 1] if n else -1.0, row, there, variance)
    return jumps


def test_a_picture_that_moves_as_predicted_is_not_steadied() -> None:
    assert not watched(JUMPS, JUMPS).is_still


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_one_that_jumps_less_is(share: float) -> None:
    assert watched(share * JUMPS, JUMPS).is_steadied


def test_what_moves_on_evenly_does_not_hide_it() -> None:
    assert watched(np.full_like(JUMPS, 0.02), 0.02 + JUMPS).is_steadied


def test_jumps_elsewhere_are_not_missing() -> None:
    late = np.roll(JUMPS, 1, axis=0)
    assert not watched(JUMPS, late).is_still


def test_a_robot_that_moves_on_does_not_jump_because_pictures_are_dated_wrongly() -> None:
    dates = np.arange(90) / 30.0 + np.random.default_rng(2).uniform(-0.012, 0.012, 90)
    predicted = 0.2 * np.diff(dates, prepend=-1.0 / 30.0)[:, None] * np.ones(2)
    jumps = watched(np.full_like(predicted, 0.2 / 30.0), predicted, dates=dates)
    assert not jumps.is_steadied


def test_a_steadied_picture_is_forgotten_where_dates_tell_nothing() -> None:
    dates = np.concatenate((np.arange(45) / 30.0, 1.5 + np.cumsum(np.tile([0.02, 0.05], 23))[:45]))
    assert watched(0.3 * JUMPS[:45], JUMPS[:45]).is_still
    assert not watched(0.3 * JUMPS, JUMPS, dates=dates).is_still


def test_pictures_that_were_not_believed_are_no_jump() -> None:
    """Each is held against where the last one believed was: what is predicted grows, and is back
    with the next one believed."""
    jumps, step_m = SteadiedPicture(), 0.2 / 30.0
    for n in range(60):
        believed = n - 1 if not 20 < n < 40 else 20
        there = np.array([step_m * (n - believed), 0.0])
        jumps.add(n / 30.0, believed / 30.0, np.array([step_m, 0.0]), there, NOISE_M2)
        assert not jumps.is_still


def test_noise_is_not_predicted_jumps() -> None:
    assert not watched(0.0 * JUMPS, JUMPS, variance=1e-5).is_steadied


def test_some_pictures_are_too_few_to_say_so() -> None:
    assert not watched(0.0 * JUMPS[:5], JUMPS[:5]).is_steadied


@pytest.mark.parametrize(("pictures_hz", "tells"), [(5.0, False), (9.0, False), (12.0, True)])
def test_pictures_too_far_apart_for_a_hands_trembling_tell_nothing(pictures_hz, tells) -> None:
    """A robot of light was led well by five a second, and called steadied after ten seconds."""
    jumps = watched(0.3 * JUMPS, JUMPS, dates=np.arange(90) / pictures_hz)
    assert jumps.is_steadied == tells
