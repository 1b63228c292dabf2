"""Samples that are cut off are known for it, and are not believed."""

from math import inf

import numpy as np
import pytest

from hardware.sim.world import evaluator
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.estimation.full_scale import LOUD, FullScale
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import RelativeConfig
from tests.pipeline.way import PHONE, Way


def heard(sizes):
    """(the limit, how many were cut off) of samples of these sizes along an axis."""
    scale = FullScale(LOUD[1])
    cut = [scale.hear(np.array([0.1, -size, 0.2])) for size in sizes]
    return scale.limit, sum(cut)


def test_a_shaken_sensor_is_cut_off_where_it_says_the_same_twice():
    wave = np.round(25.0 * np.abs(np.sin(2.0 * np.pi * 3.0 * np.arange(60) / 60.0)), 1)
    assert heard(wave) == (inf, 0)
    limit, cut = heard(np.minimum(wave, 19.6))
    assert limit == 19.6
    assert cut == (np.minimum(wave, 19.6) == 19.6).sum() - 1  # the first may have been a peak


def test_a_sensor_at_rest_and_one_that_says_more_later_have_no_limit():
    assert heard([9.8] * 50) == (inf, 0)
    assert heard([19.6, 19.6, 19.6, 30.0, 19.6, 19.6]) == (inf, 2)


def test_a_sample_at_full_scale_is_doubted_on_its_axis_alone():
    doubts = []
    for limit in (inf, 1.4):
        way = Way()
        way.full_scale = limit
        way.go(0.2, 0.4)
        doubts.append(way.sigma(6))
    assert np.abs(PHONE[1][:, 3:5]).max() > 1.4
    assert doubts[1] > 1.5 * doubts[0]


@pytest.mark.slow
def test_a_phone_that_is_shaken_beyond_its_accelerometer_is_found_again():
    world = World(WorldOptions(seed=5, duration=10.0, hand="shaken"))
    estimator = RelativeFilter(RelativeConfig(), LEDS_IN_B)
    track = evaluator.run(estimator, world)
    shaken = track.now.during(6.2, 8.5)
    assert np.linalg.norm(shaken.e[:, :3], axis=1).max() < 0.08
    assert np.nanmean(shaken.nees()) < 14.0
