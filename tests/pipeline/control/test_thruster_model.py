"""What thrusters give, and will give, beside a simulation in steps of 20 µs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.control.thruster_model import ThrusterModel
from pipeline.frames import Array

AMES = load_robot("ames").robot
FINE = 20e-6


def simulated(times: Array, told: Array, until: float, lag: float, delay: float) -> Array:
    """(n, 6) what thrusters give every `FINE` seconds, told (k, 6) from each of the times on."""
    given, rows = np.zeros(6), []
    for t in np.arange(0.0, until, FINE):
        k = int(np.searchsorted(times, t - delay + 1e-9, side="right")) - 1
        wanted = told[k] if k >= 0 else np.zeros(6)
        given = given + FINE / lag * (wanted - given)
        rows.append(given)
    return np.array(rows)


@pytest.mark.parametrize(("lag", "delay"), [(0.025, 0.015), (0.04, 0.0), (0.015, 0.032)])
def test_it_gives_what_thrusters_give_and_knows_what_they_will(lag: float, delay: float) -> None:
    rng = np.random.default_rng(3)
    model = ThrusterModel(replace(AMES, thrust_lag_s=lag, thrust_delay_s=delay), 6)
    periods = rng.choice([0.005, 0.004, 0.0102, 0.02], 40)
    times, told = np.concatenate(([0.0], np.cumsum(periods))), rng.normal(size=(41, 6))
    now = times[-1]
    truth = simulated(times[:-1], told[:-1], now + delay, lag, delay)
    for h, wrench in zip(periods, told, strict=False):
        model.follow(wrench, h)
    np.testing.assert_allclose(model.given, truth[round(now / FINE) - 1], atol=5e-3)
    given, once, twice = model.ahead()
    coming = truth[round(now / FINE) :]
    np.testing.assert_allclose(given, truth[-1], atol=5e-3)
    np.testing.assert_allclose(once, FINE * coming.sum(axis=0), atol=1e-4)
    np.testing.assert_allclose(twice, FINE * FINE * coming.cumsum(axis=0).sum(axis=0), atol=1e-5)


def test_who_asks_does_not_change_what_is_given() -> None:
    model = ThrusterModel(AMES, 6)
    for _ in range(3):
        model.follow(np.ones(6), 0.005)
    before = model.given.copy()
    assert (model.ahead()[0] > before).all()
    np.testing.assert_array_equal(model.given, before)


def test_periods_too_short_to_be_kept_for_the_delay_end_at_the_same() -> None:
    model = ThrusterModel(AMES, 6)
    for _ in range(4000):
        model.follow(np.ones(6), 1e-4)
    np.testing.assert_allclose(model.given, np.ones(6), atol=1e-3)
