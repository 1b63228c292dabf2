"""A lag that was misjudged is seen in lights that move, and in no others."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.frames import Array
from pipeline.glass.lag_tracker import LEAST_S, LagTracker

PLACES = np.array([[-0.05, 0.02], [0.0, 0.05], [0.06, 0.0], [0.01, -0.04], [-0.03, -0.05]])
SIZE_M = 0.010


def places(t: float, size_m: float = SIZE_M) -> Array:
    """Five lights that move together, 5 cm/s at most."""
    moved: Array = PLACES + size_m * np.array([np.sin(4.0 * t), np.cos(5.0 * t)])
    return moved


def filmed(
    error_s: float, seconds: float = 3.0, size_m: float = SIZE_M, seed: int = 0, held: float = 0.0
) -> LagTracker:
    """Lights drawn for 60 times a second, filmed 30 times, `error_s` after what is believed.

    `held` of what a picture errs in common goes over to the next.
    """
    rng, tracker, eye = np.random.default_rng(seed), LagTracker(), np.zeros(2)
    for k in range(int(60 * seconds)):
        t = 100.0 + k / 60.0
        tracker.add_drawn(t + 0.05, places(t + 0.05, size_m))
        if k % 2 and k > 6:
            eye = held * eye + np.sqrt(1.0 - held * held) * 2e-4 * rng.standard_normal(2)
            seen = places(t + error_s, size_m) + 0.001 + eye + 1e-4 * rng.standard_normal((5, 2))
            stray = rng.uniform(-0.2, 0.2, (1, 2))
            tracker.add_seen(t, np.concatenate((stray, seen)))
    return tracker


@pytest.mark.parametrize("held", [0.0, 0.8])
def test_its_deviation_is_honest_where_pictures_in_a_row_err_alike(held: float) -> None:
    found = [filmed(0.01, seed=seed, held=held).error() for seed in range(40)]
    off = [one.value - 0.01 for one in found if one is not None]
    sigmas = [one.sigma for one in found if one is not None]
    assert len(off) == 40
    assert 0.6 < np.sqrt(np.mean(np.square(off)) / np.mean(np.square(sigmas))) < 1.6


@pytest.mark.parametrize("by_s", [0.02, 0.005, -0.01])
def test_what_was_corrected_is_an_error_no_more(by_s: float) -> None:
    tracker = filmed(0.02)
    before = tracker.error()
    tracker.corrected(by_s)
    after = tracker.error()
    assert before is not None
    assert after is not None
    assert after.value == pytest.approx(before.value - by_s, abs=1e-9)
    assert after.sigma == pytest.approx(before.sigma)


@pytest.mark.parametrize("seed", range(1000, 1004))
@pytest.mark.parametrize("error_s", [0.0, 0.02, -0.02, 0.005])
def test_it_is_found_to_three_milliseconds_and_as_sure_as_it_says(
    error_s: float, seed: int
) -> None:
    found = filmed(error_s, seed=seed).error()
    assert found is not None
    assert abs(found.value - error_s) < 0.003
    assert abs(found.value - error_s) < 4.0 * found.sigma


def test_lights_that_stand_tell_nothing() -> None:
    assert filmed(0.02, size_m=0.0).error() is None
    assert filmed(0.02, size_m=1e-4).error() is None


def test_too_few_tell_nothing() -> None:
    assert filmed(0.02, seconds=0.9 * LEAST_S).error() is None
    seldom = LagTracker()
    for k in range(180):
        t = k / 60.0
        seldom.add_drawn(t + 0.05, places(t + 0.05))
        if k % 30 == 29:
            seldom.add_seen(t, places(t + 0.02))
    assert seldom.error() is None


def test_lights_that_are_not_the_robots_count_for_nothing() -> None:
    tracker = LagTracker()
    for k in range(300):
        tracker.add_drawn(0.01 * k, places(0.01 * k))
        tracker.add_seen(0.01 * k - 0.03, places(0.01 * k) + 0.02)
    assert tracker.error() is None


def test_places_that_are_not_on_the_glass_are_no_places() -> None:
    tracker = LagTracker()
    for k in range(300):
        tracker.add_drawn(0.01 * k, np.full((5, 2), np.nan))
        tracker.add_seen(0.01 * k - 0.03, places(0.01 * k))
    assert tracker.error() is None
