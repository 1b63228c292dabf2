"""Bad motion samples are doubted, good ones are not, and wrong pictures are no fault of theirs."""

import numpy as np
import pytest

from hardware.sim.world.sensors import feed
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.adaptive_noise import FAR, MOST, AdaptiveNoise
from pipeline.estimation.estimator import Fusion
from tests.pipeline.flight import new

P = 1e-8 * np.eye(6)
"""Of what was predicted: 0.1 mm, 0.1 mrad."""
C = 0.25 * P
SIGMA = np.sqrt(1.25e-8)


def judged(doubt: AdaptiveNoise, error: np.ndarray, predicted: np.ndarray = P) -> float:
    """The stretch for a picture that is (δp, θ) off."""
    return doubt.judge(error, predicted, C)


def scattered(doubt: AdaptiveNoise, times: float, count: int, seed: int = 0) -> np.ndarray:
    """Pictures that miss by `times` what is said of them; the stretch of each."""
    rng = np.random.default_rng(seed)
    return np.array([judged(doubt, times * SIGMA * rng.normal(size=6)) for _ in range(count)])


def test_who_predicts_as_well_as_said_is_believed():
    doubt = AdaptiveNoise()
    assert (scattered(doubt, 1.0, 3000) > 1.0).mean() < 0.004
    factors = [(scattered(doubt, 1.0, 30, seed), doubt.factor)[1] for seed in range(50)]
    assert np.mean(factors) < 1.2


def test_samples_that_predict_worse_are_doubted_and_believed_again():
    doubt = AdaptiveNoise()
    scattered(doubt, 4.0, 30)
    assert doubt.factor > 16.0
    scattered(doubt, 0.5, 200)
    assert doubt.factor == 1.0


def test_a_picture_far_off_stretches_what_was_predicted_until_it_fits():
    error = 30.0 * SIGMA * np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    inflation = judged(AdaptiveNoise(), error)
    for times, fits in ((1.0, True), (0.5, False)):
        S = times * inflation * P + C
        assert (error @ np.linalg.solve(S, error) / 6.0 <= 1.0) == fits


def test_a_picture_nearly_far_off_stretches_nothing():
    assert judged(AdaptiveNoise(), SIGMA * np.sqrt(0.99 * FAR) * np.ones(6)) == 1.0


def test_a_picture_farther_off_than_bad_samples_explain_is_left_to_the_gates():
    assert judged(AdaptiveNoise(), 110.0 * np.sqrt(6.0) * SIGMA * np.eye(6)[1]) == 1.0


def test_the_factor_has_an_end():
    doubt = AdaptiveNoise()
    assert (scattered(doubt, 100.0, 1000)[-1]) == 1.0
    assert doubt.factor == pytest.approx(MOST)


def test_pictures_that_scatter_of_themselves_are_no_reason_to_doubt_the_sensors():
    doubt = AdaptiveNoise()
    rng = np.random.default_rng(0)
    for _ in range(100):
        judged(doubt, 2.0 * 0.5e-4 * rng.normal(size=6), predicted=1e-4 * P)
    assert doubt.factor < 1.1


@pytest.mark.slow
def test_a_phone_that_dates_its_samples_badly_costs_no_leds():
    """8 ms of jitter; believed as their data sheet says, they cost a fifth of all LEDs."""
    rejected = 0
    for seed in range(3):
        world, estimator = World(WorldOptions(seed=seed, duration=6.0, stamp_jitter=0.008)), new()
        for _ in feed(estimator, world):
            pass
        rejected += estimator.leds_rejected
        assert estimator.pictures[Fusion.FUSED] > 160
    assert rejected < 0.06 * 3 * 5 * 177
