"""The hand-motion predictor: learns this hand, knows how wrong it is, never worse than holding."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.measured_hands import SPECTRA
from hardware.sim.world import sensors
from hardware.sim.world.world import GRID_S, World, WorldOptions
from pipeline.estimation.hand_motion_kernels import AHEAD, STEP_S, TAPS, forecast_at
from pipeline.estimation.hand_predictor import KINDS, LEARNT, NOTHING, SETTLED_S, HandPredictor
from pipeline.estimator_config import HandConfig
from pipeline.imu_stream import ImuStream

BIAS = np.array([0.01, -0.02, 0.005])


def turn(forecast, ahead_s):
    """(3,) what a forecast adds up to."""
    row, out = np.zeros(6), np.zeros(3)
    for k in range(20):
        forecast_at(forecast, (k + 0.5) * ahead_s / 20, row)
        out += row[:3] * ahead_s / 20
    return out


def wrong_by(world, predictor, ahead_s, start_s):
    """Errors (n, 3) of the turns predicted after each sample, and what was believed of them."""
    turned = np.cumsum(GRID_S * world.omega_c, axis=0)
    stream, errors, sigmas, row = ImuStream(), [], [], np.zeros(6)
    for _, sample in sorted(sensors.phone_samples(world), key=lambda event: event[1].t):
        stream.insert(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)
        predictor.follow(stream)
        if start_s < sample.t < world.t[-1] - ahead_s:
            i, j = world.index([sample.t, sample.t + ahead_s])
            errors.append(turn(predictor.forecast, ahead_s) - (turned[j] - turned[i]))
            forecast_at(predictor.forecast, ahead_s, row)
            sigmas.append(row[3:].copy())
    return np.array(errors), np.array(sigmas)


def rms(errors):
    return np.sqrt(np.square(errors).mean())


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SPECTRA, "trembling_13_hz"])
@pytest.mark.parametrize("ahead_s", [0.06, 0.09])
def test_for_every_hand_the_learnt_forecast_is_better_than_holding_and_than_none(name, ahead_s):
    world = World(WorldOptions(seed=5, duration=18.0, hand=name))
    found = {}
    for kind in KINDS:
        errors, sigmas = wrong_by(
            world, HandPredictor(replace(HandConfig(), predictor=kind)), ahead_s, 7.0
        )
        found[kind] = rms(errors)
        assert 0.75 < rms(errors / sigmas) < 1.2, kind
    assert found["learnt"] < 0.95 * found["hold"]
    assert found["learnt"] < found["none"]


def feed(predictor, rates, period_s=STEP_S):
    stream = ImuStream()
    for k, rate in enumerate(rates):
        stream.insert(k * period_s, rate, np.zeros(3))
        predictor.follow(stream)
    return stream


def test_what_can_only_be_held_is_held():
    """A random walk: the learnt weights can't win, and holding is as good as it gets."""
    rng = np.random.default_rng(1)
    predictor = HandPredictor(HandConfig())
    feed(predictor, BIAS + np.cumsum(0.02 * rng.normal(size=(900, 3)), axis=0))
    learnt, hold, _ = (turns[:6].sum() for turns in predictor.turns)
    assert predictor.turns[KINDS.index(predictor.kind), :6].sum() == min(learnt, hold)
    assert predictor.forecast[6, 3:] == pytest.approx(
        np.sqrt(predictor.turns[KINDS.index(predictor.kind), 5])
    )


def test_of_noise_nothing_is_expected():
    rng = np.random.default_rng(2)
    predictor = HandPredictor(HandConfig())
    feed(predictor, BIAS + 0.05 * rng.normal(size=(900, 3)))
    assert np.abs(predictor.forecast[1:, :3]).max() < 0.05
    assert predictor.kind != "hold"


@pytest.mark.parametrize("period_s", [1 / 50, 1 / 60, 1 / 100, 1 / 200])
def test_a_tremor_is_predicted_whatever_the_rate_of_the_samples(period_s):
    predictor = HandPredictor(HandConfig())
    t = period_s * np.arange(round(8.0 / period_s))

    def rates(t):
        return BIAS + 0.1 * np.sin(2.0 * np.pi * 7.0 * t[:, None] + np.arange(3))

    feed(predictor, rates(t), period_s)
    expected = rates(t[-1] + STEP_S * np.arange(AHEAD + 1))
    assert np.abs(predictor.forecast[:, :3] - expected).max() < 0.025


def test_learning_is_least_squares_that_forget():
    """Against the normal equations of all windows at once."""
    config = HandConfig()
    rng, predictor = np.random.default_rng(3), HandPredictor(config)
    rates = np.cumsum(0.01 * rng.normal(size=(80, 3)), axis=0)
    n = len(rates) - round(SETTLED_S / STEP_S)
    feed(predictor, rates)
    keep = np.exp(-STEP_S / config.memory_s)
    strength = 3.0 * config.prior_s / STEP_S * config.noise**2
    A, B = strength * np.eye(TAPS), strength * predictor._prior
    for last in range(TAPS + AHEAD - 1, n):
        before = rates[last - AHEAD - np.arange(TAPS)]
        came = rates[last - AHEAD + 1 + np.arange(AHEAD)]
        weight = keep ** (n - 1 - last)
        A, B = A + weight * before @ before.T, B + weight * before @ came.T
    assert np.abs(predictor._weights[LEARNT] - np.linalg.solve(A, B)).max() < 1e-6


def test_without_enough_samples_nothing_is_predicted():
    predictor, rates = HandPredictor(HandConfig()), np.tile(BIAS, (TAPS, 1))
    feed(predictor, rates[:-1])
    assert predictor.forecast is NOTHING
    stream = feed(predictor, rates)
    assert predictor.forecast.shape == (AHEAD + 1, 6)
    stream.insert(stream.newest + 0.3, BIAS, np.zeros(3))
    predictor.follow(stream)
    assert predictor.forecast is NOTHING


def test_a_phone_that_lies_still_is_expected_to_and_forgets_nothing_it_may_need():
    rng, predictor = np.random.default_rng(4), HandPredictor(HandConfig())
    stream = feed(predictor, BIAS + 0.05 * rng.normal(size=(300, 3)))
    for k in range(1200):
        stream.insert(stream.newest + STEP_S, BIAS, np.zeros(3))
        predictor.follow(stream)
        assert np.isfinite(predictor.forecast).all(), k
    assert np.abs(predictor.forecast[:, :3] - BIAS).max() < 0.005


def test_beyond_its_end_a_forecast_holds_its_last_rate_with_growing_doubt():
    predictor, row = HandPredictor(HandConfig()), np.zeros(6)
    feed(predictor, BIAS + np.random.default_rng(5).normal(size=(60, 3)))
    doubts = []
    for after in (AHEAD, AHEAD + 5, AHEAD + 50):
        forecast_at(predictor.forecast, after * STEP_S, row)
        assert row[:3] == pytest.approx(predictor.forecast[-1, :3])
        doubts.append(row[3])
    assert doubts[0] < doubts[1] < doubts[2]
    forecast_at(predictor.forecast, 0.0, row)
    assert row[3:] == pytest.approx(np.zeros(3))
