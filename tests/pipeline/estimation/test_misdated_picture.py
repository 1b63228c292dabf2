"""A picture of a wrong date is told from a wrong prediction, and believed less along its motion."""

import numpy as np
import pytest

from hardware.sim.world.sensors import events
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.estimation.adaptive_noise import FAR, misfit
from pipeline.estimation.believed_less import widened
from pipeline.estimation.misdated_picture import MisdatedPictures
from pipeline.frames import exp
from pipeline.signals import VisionMeasurement
from tests.pipeline.honest_camera import followed

S = np.diag(np.square([0.003, 0.0005, 0.0005, 0.001, 0.0014, 0.0014]))
PASSING = np.array([0.05, 0.3, -0.2, 0.02, -0.05, 0.1])


@pytest.fixture(scope="module")
def seen():
    arriving = events(World(WorldOptions(seed=11, duration=0.5)))
    return next(one for _, one in arriving if isinstance(one, VisionMeasurement))


@pytest.mark.parametrize("late_s", [-0.03, 0.02, 0.035])
def test_what_its_date_explains_is_believed_less_along_its_motion_alone(seen, late_s):
    e = late_s * PASSING
    assert misfit(e, S) > FAR
    less = MisdatedPictures().explained(seen, LEDS_IN_B, e, S, PASSING)
    more = less.pose.covariance - seen.pose.covariance
    assert misfit(e, S + more) < 1.0
    across = np.array([0.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    assert across @ more @ across == pytest.approx(0.0, abs=1e-12)
    wider = less.rays.covariances - seen.rays.covariances
    assert (np.linalg.eigvalsh(wider)[:, 1] > 1e-7).all()
    assert np.abs(np.linalg.eigvalsh(wider)[:, 0]).max() < 1e-12


def test_what_all_leds_are_off_by_together_is_one_error_not_five(seen):
    """Each as unsure as that alone would say, they would average it out."""
    moved = 0.02 * PASSING
    _, rays = widened(seen.pose, seen.rays, LEDS_IN_B, moved[:3], moved[3:])
    led, ahead = seen.rays.led, 1e-6
    p, R = seen.pose.p_bc_in_c, seen.pose.R_cb
    here, there = (
        q + LEDS_IN_B[led] @ Q.T
        for q, Q in ((p, R), (p + ahead * moved[:3], R @ exp(ahead * moved[3:])))
    )
    off = (there[:, 1:] / there[:, :1] - here[:, 1:] / here[:, :1]) / ahead
    sizes = np.einsum("ni,nij,nj->n", off, np.linalg.inv(rays.covariances), off)
    assert 0.9 < sizes.sum() < 1.0


def test_what_no_date_explains_is_a_wrong_prediction(seen):
    aside = 0.02 * np.array([0.0, 0.2, 0.3, 0.0, 0.0, 0.0])
    assert misfit(aside, S) > FAR
    assert MisdatedPictures().explained(seen, LEDS_IN_B, aside, S, PASSING) is None


def test_a_date_is_not_wrong_by_a_tenth_of_a_second(seen):
    assert MisdatedPictures().explained(seen, LEDS_IN_B, 0.1 * PASSING, S, PASSING) is None


def test_twice_running_is_no_stumble(seen):
    misdated, e = MisdatedPictures(), 0.03 * PASSING
    assert misdated.explained(seen, LEDS_IN_B, e, S, PASSING) is not None
    assert misdated.explained(seen, LEDS_IN_B, e, S, PASSING) is None
    assert misdated.explained(seen, LEDS_IN_B, 0.0 * e, S, PASSING) is None
    assert misdated.explained(seen, LEDS_IN_B, e, S, PASSING) is not None


def test_the_same_date_twice_running_is_that_of_all_pictures_from_now_on(seen):
    misdated, e = MisdatedPictures(), 0.016 * PASSING
    for is_second in (False, True):
        misdated.explained(seen, LEDS_IN_B, e, S, PASSING)
        assert misdated.are_redated is is_second


@pytest.mark.parametrize("periods", [(1, 2), (2, 1), (-1, 1), (1, 0)])
def test_what_stands_or_stumbles_is_dated_by_nothing(seen, periods):
    misdated = MisdatedPictures()
    for n in periods:
        misdated.explained(seen, LEDS_IN_B, 0.02 * n * PASSING, S, PASSING)
        assert not misdated.are_redated


@pytest.mark.parametrize(
    ("adversity", "seed", "most_m"),
    [
        ("a longer exposure", 2002, 0.025),
        ("a longer exposure", 2003, 0.025),
        ("dates half a frame earlier", 2003, 0.02),
    ],
)
def test_dates_that_change_for_good_are_learnt_and_lose_nothing(adversity, seed, most_m):
    """32, 38 and 72 mm before, the first sure of its place to 0.07 m alone."""
    farthest, sigma = followed(adversity, seed, 20.0)
    assert farthest < most_m
    assert sigma < 0.06  # or it is COAST: `EnvelopeConfig.max_sigma_p_m`


def test_dates_that_change_at_once_are_told_from_what_else_pictures_are_off_by():
    """Not in each film: one of 28 mistakes them for a bias. 33 mm where no date is learnt anew."""
    films = [followed("dates half a frame earlier", seed, 20.0)[0] for seed in range(2002, 2007)]
    assert np.median(films) < 0.025
    assert max(films) < 0.06


@pytest.mark.parametrize(
    ("adversity", "seed"),
    [("dates that stumble", 3000), ("dates that stumble", 3003), ("a starved browser", 3004)],
)
def test_a_browser_that_misdates_pictures_does_not_throw_the_estimate_off(adversity, seed):
    """624, 348 and 441 mm, while such a picture was fused into a speed."""
    farthest, sigma = followed(adversity, seed, 20.0)
    assert farthest < 0.06
    assert sigma < 0.12
