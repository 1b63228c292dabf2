"""LEDs that scatter more than vision says are believed less, and no motion passes for that."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world import evaluator, metrics
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.spot_noise import MOST, SpotNoise
from tests.pipeline.flight import new

FREEDOMS = 4


def learnt(times, pictures=90, noise=None, seed=0):
    """After pictures whose misfit is that of noise `times` as large."""
    rng, noise = np.random.default_rng(seed), noise or SpotNoise()
    for chi2 in times**2 * rng.chisquare(FREEDOMS, pictures):
        noise.learn(chi2 / noise.factor, FREEDOMS)
    return noise


def test_spots_as_good_as_said_are_believed():
    factors = [learnt(1.0, seed=seed).factor for seed in range(200)]
    assert np.mean(np.array(factors) > 1.0) < 0.1
    assert max(factors) < 1.6


def test_worse_ones_are_believed_as_far_as_they_fit_and_soon_again():
    noise = learnt(2.5)
    assert noise.factor == pytest.approx(6.25, rel=0.3)
    assert learnt(1.0, pictures=150, noise=noise).factor == 1.0


def test_one_picture_teaches_little_and_the_factor_has_an_end():
    noise = SpotNoise()
    noise.learn(1e9, FREEDOMS)
    assert noise.factor < 1.4
    assert learnt(1e3, pictures=900).factor == MOST


@pytest.mark.slow
def test_the_filter_knows_how_well_it_knows_by_leds_that_scatter():
    base = WorldOptions(duration=9.0, hand="filming")
    for options, most in (({"pixel_noise": 2.5}, 9.0), ({}, 8.0)):
        worlds = [World(replace(base, seed=seed, **options)) for seed in (61, 62)]
        score = metrics.judge([evaluator.run(new(), world) for world in worlds], start=4.0)
        assert 3.5 < score.nees < 8.5
        assert score.now_mm < most
