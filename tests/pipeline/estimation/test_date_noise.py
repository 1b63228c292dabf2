"""How far pictures' dates scatter is learnt; what sensors or LEDs do wrong is not taken for it."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world.sensors import events
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.estimation.date_noise import FIRST_S, DateNoise
from pipeline.signals import VisionMeasurement

S = np.diag(np.square([0.003, 0.0002, 0.0002, 0.0006, 0.0008, 0.0008]))
FAST = np.array([0.05, 0.3, -0.2, 0.02, -0.05, 0.1])


def learnt(jitter_s, pictures=300, stretch=1.0, passing=FAST, seed=0, dates=None, late_s=0.0):
    """What is made of pictures whose dates are off by so much, predicted `stretch` times worse."""
    rng, dates = np.random.default_rng(seed), dates or DateNoise()
    for _ in range(pictures):
        passes = passing * rng.uniform(0.2, 1.0)
        e = stretch * np.sqrt(np.diag(S)) * rng.standard_normal(6)
        dates.learn(e + (late_s + jitter_s * rng.standard_normal()) * passes, S, passes)
    return dates


@pytest.mark.parametrize("jitter_s", [0.002, 0.004, 0.01])
def test_how_far_dates_scatter_is_learnt(jitter_s):
    found = [learnt(jitter_s, seed=seed).sigma_s for seed in range(10)]
    assert np.mean(found) == pytest.approx(jitter_s, rel=0.3)
    assert 0.5 * jitter_s < min(found) < max(found) < 1.6 * jitter_s


def test_within_half_a_second():
    found = [learnt(0.004, pictures=15, seed=seed).sigma_s for seed in range(20)]
    assert np.median(found) > 0.002


def test_right_dates_are_believed():
    found = [learnt(0.0, seed=seed).sigma_s for seed in range(20)]
    assert np.median(found) == 0.0
    assert max(found) < 0.0012


def test_what_all_pictures_are_late_by_is_the_time_offset_s():
    found = [learnt(0.0, seed=seed, late_s=0.004).sigma_s for seed in range(10)]
    assert max(found) < 0.0012


def test_and_believed_again():
    dates = learnt(0.008)
    assert dates.sigma_s > 0.005
    assert learnt(0.0, pictures=200, dates=dates).sigma_s < 0.001


def test_what_is_off_in_all_directions_is_no_date():
    assert np.mean([learnt(0.0, stretch=3.0, seed=seed).sigma_s for seed in range(10)]) < 0.0015


def test_who_stands_still_tells_nothing_of_dates():
    """What a camera is taken for that nobody knows is kept."""
    assert learnt(0.01, passing=1e-3 * FAST).sigma_s == pytest.approx(FIRST_S, rel=0.1)


def test_what_is_no_number_teaches_nothing():
    dates = learnt(0.004)
    before = dates.sigma_s
    dates.learn(np.full(6, np.nan), S, FAST)
    dates.learn(np.zeros(6), np.full((6, 6), np.nan), FAST)
    assert dates.sigma_s == before
    assert learnt(0.008, dates=dates).sigma_s > before


def test_a_picture_is_doubted_along_its_motion_alone():
    arriving = events(World(WorldOptions(seed=11, duration=0.5)))
    seen = next(one for _, one in arriving if isinstance(one, VisionMeasurement))
    dates, pose = learnt(0.004), seen.pose
    less = dates.inflated(seen, LEDS_IN_B, pose.p_bc_in_c, pose.R_cb, FAST)
    more = less.pose.covariance - pose.covariance
    np.testing.assert_allclose(more, dates.sigma_s**2 * np.outer(FAST, FAST), atol=1e-15)
    wider = np.linalg.eigvalsh(less.rays.covariances - seen.rays.covariances)
    assert (wider[:, 1] > 1e-7).all()
    assert np.abs(wider[:, 0]).max() < 1e-12
    alone = replace(seen, pose=None)
    few = dates.inflated(alone, LEDS_IN_B, pose.p_bc_in_c, pose.R_cb, FAST)
    np.testing.assert_array_equal(few.rays.covariances, less.rays.covariances)
    right = learnt(0.0)
    assert right.sigma_s == 0.0
    assert right.inflated(seen, LEDS_IN_B, pose.p_bc_in_c, pose.R_cb, FAST) is seen
