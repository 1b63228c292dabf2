"""A tone is told from noise, from hands and from a robot's own motion by the samples alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.estimation.tones import EVERY_S, MOST, PHONE, PICTURES, ROBOT, ToneLimits, Tones
from pipeline.frames import Array

Wave = Callable[[float], Array]
ALONG = np.array([0.6, 0.0, 0.8])
STILL = np.zeros(3)


def none(_: float) -> Array:
    return STILL


def sine(hz: float, size: float) -> Wave:
    return lambda t: size * np.sin(2.0 * np.pi * hz * t + 0.3) * ALONG


def heard(
    limits: ToneLimits,
    gyroscope: Wave = none,
    accelerometer: Wave = none,
    period: float = 0.005,
    seconds: float = 6.0,
    noise: tuple[float, float] = (0.005, 0.1),
    seed: int = 1,
) -> list[bool]:
    """Whether gyroscope and accelerometer ever had a tone."""
    rng, tones = np.random.default_rng(seed), Tones(limits)
    for t in np.arange(0.0, seconds, period).tolist():
        rate, force = (one(t) for one in (gyroscope, accelerometer))
        tones.add(
            t, rate + noise[0] * rng.normal(size=3), force + noise[1] * rng.normal(size=3) + 9.8
        )
    found: list[bool] = np.isfinite(tones.t_heard).tolist()
    return found


@pytest.mark.parametrize("hz", [9.0, 35.0, 80.0, 99.0, 140.0, 215.0, 1040.0])
def test_a_tone_is_heard_of_the_sensor_that_feels_it_also_beyond_half_the_sample_rate(
    hz: float,
) -> None:
    assert heard(ROBOT, accelerometer=sine(hz, 2.0)) == [False, True]
    assert heard(ROBOT, gyroscope=sine(hz, 0.1)) == [True, False]


@pytest.mark.parametrize("hz", [2.0, 5.0, 6.5, 195.0])
def test_what_a_robot_may_do_itself_is_none(hz: float) -> None:
    assert heard(ROBOT, sine(hz, 0.5), sine(hz, 5.0)) == [False, False]


def test_a_tone_beside_a_slow_motion_that_is_larger_is_heard() -> None:
    def both(t: float) -> Array:
        return sine(2.0, 6.0)(t) + sine(70.0, 1.5)(t)

    assert heard(ROBOT, accelerometer=both) == [False, True]


def test_of_a_phone_what_is_as_slow_as_a_tremor_is_none() -> None:
    for hz, is_tone in ((9.0, False), (13.0, False), (20.0, True), (43.0, True)):
        assert heard(PHONE, accelerometer=sine(hz, 2.0), period=1.0 / 60.0)[1] == is_tone


def test_what_is_small_is_none() -> None:
    assert heard(ROBOT, sine(40.0, 0.04), sine(40.0, 0.8)) == [False, False]


@pytest.mark.parametrize("noise", [(0.1, 2.0), (0.4, 8.0)])
def test_noise_is_none_however_loud(noise: tuple[float, float]) -> None:
    said = [heard(ROBOT, noise=noise, seconds=20.0, seed=seed) for seed in range(6)]
    assert np.sum(said) == 0


def test_a_motion_of_many_frequencies_is_none() -> None:
    """A walk of the acceleration, and a line as wide as a tremor's."""
    rng, place = np.random.default_rng(2), np.zeros(3)

    def walk(_: float) -> Array:
        place[:] = 0.99 * place + 0.8 * rng.normal(size=3)
        return place.copy()

    assert heard(ROBOT, accelerometer=walk, seconds=20.0) == [False, False]
    hump, phase = np.random.default_rng(3), 0.0

    def tremor(_: float) -> Array:
        nonlocal phase
        phase += 2.0 * np.pi * 0.005 * 20.0 + 0.3 * hump.normal()
        return 4.0 * np.sin(phase) * ALONG

    assert heard(ROBOT, accelerometer=tremor, seconds=20.0) == [False, False]


def test_a_knock_is_none_and_a_tone_that_begins_is_heard_within_two_windows() -> None:
    def knock(t: float) -> Array:
        return sine(40.0, 30.0)(t) if 3.0 < t < 3.06 else STILL

    assert heard(ROBOT, accelerometer=knock) == [False, False]
    tones = Tones(ROBOT)
    for t in np.arange(0.0, 8.0, 0.005).tolist():
        if np.isfinite(tones.t_heard[1]):
            break
        tones.add(t, STILL, sine(60.0, 2.0)(t) if t > 3.0 else STILL)
    assert 3.0 < tones.t_heard[1] < 3.0 + ROBOT.window_s + EVERY_S


def test_after_a_gap_it_begins_again_and_late_or_double_samples_tell_nothing() -> None:
    tones, wave = Tones(ROBOT), sine(60.0, 2.0)
    for k in range(4):
        for t in np.arange(3.0 * k, 3.0 * k + 1.9, 0.005).tolist():
            tones.add(t, STILL, wave(t))
    assert not np.isfinite(tones.t_heard).any()
    for t in np.arange(20.0, 24.0, 0.005).tolist():
        tones.add(t, STILL, wave(t))
        tones.add(t - 0.05, STILL, np.full(3, 50.0))
        tones.add(t + 2e-5, STILL, wave(t))
    assert np.isfinite(tones.t_heard).tolist() == [False, True]


def test_faster_samples_than_it_holds_are_looked_at_by_shorter_windows() -> None:
    period = 1.0 / 1600.0
    assert ROBOT.window_s / period > MOST
    assert heard(ROBOT, accelerometer=sine(60.0, 2.0), period=period, seconds=4.0) == [False, True]


def test_pictures_that_are_off_to_and_fro_are_heard_by_turn_and_place() -> None:
    noise = (0.001, 0.002)
    for hz in (1.0, 3.0):
        assert heard(PICTURES, sine(hz, 0.02), period=1.0 / 30.0, noise=noise) == [True, False]
        assert heard(PICTURES, none, sine(hz, 0.012), 1.0 / 30.0, noise=noise) == [False, True]
    assert heard(PICTURES, period=1.0 / 30.0, noise=(0.005, 0.01), seconds=60.0) == [False, False]
