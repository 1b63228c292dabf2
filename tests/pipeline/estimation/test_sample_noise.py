"""Noise is told from motion and from vibration by the samples alone."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world import evaluator, metrics
from hardware.sim.world.sensor_faults import ImuFault
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.sample_noise import SampleNoise
from tests.pipeline.flight import new

SIGMAS = np.array([0.006, 0.12])


def levels(wave, period=0.005, noise=0.0, seconds=4.0, stamps=0.0, twins=False):
    """(noise, roughness) of an accelerometer that feels `wave` (t) along each axis."""
    rng, heard = np.random.default_rng(1), SampleNoise(SIGMAS)
    told = []
    for t in np.arange(0.0, seconds, period):
        at = t + stamps * rng.uniform(-1.0, 1.0)
        force = wave(at) + noise * rng.normal(size=3)
        heard.add(at, np.zeros(3), force)
        if twins:
            heard.add(at + 2e-5, np.zeros(3), force + noise * rng.normal(size=3))
        told.append(heard.levels[1].copy())
    return np.median(told[len(told) // 2 :], axis=0)


def sine(hz, size):
    return lambda t: size * np.sin(2.0 * np.pi * hz * t + np.arange(3.0))


@pytest.mark.parametrize("about", [lambda t: np.zeros(3), sine(2.0, 3.0), sine(80.0, 5.0)])
def test_noise_is_found_whatever_else_is_felt(about):
    assert levels(about, noise=2.0)[0] == pytest.approx(2.0, rel=0.25)
    assert levels(about, noise=0.1)[0] < 0.3


@pytest.mark.parametrize("options", [{"stamps": 0.001}, {"twins": True}])
def test_uneven_stamps_are_no_noise(options):
    assert levels(sine(2.0, 3.0), noise=0.2, **options)[0] == pytest.approx(0.2, rel=0.3)


def test_a_tremor_too_fast_for_the_samples_is_rough_and_no_noise():
    """White jerk of density q moves what is sampled by √(q T) from one sample to the next."""
    noise, rough = levels(sine(13.0, 1.0), period=1.0 / 60.0)
    assert noise < 0.1
    assert rough > 5.0
    rng, place = np.random.default_rng(2), np.zeros(3)

    def walk(t):
        place[:] += 4.0 * np.sqrt(1.0 / 60.0) * rng.normal(size=3)
        return place.copy()

    assert levels(walk, period=1.0 / 60.0, seconds=20.0)[1] == pytest.approx(4.0, rel=0.3)


def test_after_a_gap_it_begins_again_and_late_samples_tell_nothing():
    heard = SampleNoise(SIGMAS)
    for t in (*np.arange(0.0, 0.5, 0.005), *np.arange(5.0, 5.04, 0.005), 4.0, 5.01):
        heard.add(t, np.zeros(3), np.full(3, np.floor(t)))
    assert np.all(heard.levels == 0.0)


def test_a_knock_teaches_little():
    def knocked(t):
        return np.full(3, 50.0 if 3.0 < t < 3.004 else 0.0)

    assert levels(knocked, noise=0.1)[0] < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"body_fault": ImuFault(noise=20.0)}, {"hand": "walking"}, {"hand": "quiet"}]
)
def test_who_shakes_more_than_was_expected_is_known_as_well_as_is_said(options):
    base = WorldOptions(duration=9.0, hand="filming")
    worlds = [World(replace(base, seed=seed, **options)) for seed in (51, 52, 53)]
    score = metrics.judge([evaluator.run(new(), world) for world in worlds], start=3.0)
    assert 3.5 < score.nees < 8.0
