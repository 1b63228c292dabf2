from dataclasses import replace

import numpy as np
import pytest

from pipeline.frames import exp, log
from pipeline.identification import pnp
from pipeline.signals import Match, Spots
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, error_of, truth_at

ALL = np.arange(5)


def spots_of(pixels, sigma_px=0.1):
    n = len(pixels)
    return Spots(pixels, np.tile(sigma_px**2 * np.eye(2), (n, 1, 1)), np.ones(n), np.ones(n))


def solved(truth, noise=0.0, sigma_px=0.1, leds=ALL, guess=None):
    match = Match(np.asarray(leds), np.asarray(leds))
    return pnp.solve(CAMERA, LEDS_IN_B, spots_of(truth.pixels() + noise, sigma_px), match, guess)


@pytest.mark.parametrize("leds", [ALL, ALL[:4], ALL[1:]])
def test_noiseless_spots_give_back_the_pose(leds):
    rng = np.random.default_rng(1)
    for _ in range(20):
        truth = truth_at(rng, rng.uniform(1.0, 6.0))
        normalised = CAMERA.normalised(truth.pixels())  # its inverse is iterative: not to 1e-9
        spots = spots_of(np.zeros((5, 2)))
        weights = np.linalg.inv(spots.covariances[leds])
        start = truth.p * 1.05, truth.R @ exp(rng.normal(0.0, 0.05, 3))
        q = truth.p + LEDS_IN_B @ truth.R.T
        exact = -q[:, 1:] / q[:, :1]
        np.testing.assert_allclose(normalised, exact, atol=1e-5)
        fit = pnp.refine(CAMERA, LEDS_IN_B[leds], exact[leds], weights, *start)
        assert np.linalg.norm(fit.p_bc_in_c - truth.p) < 1e-9
        assert np.linalg.norm(log(fit.R_cb.T @ truth.R)) < 1e-9
        by_algebra = [p for p, _ in pnp.starts(LEDS_IN_B[leds], exact[leds])]
        assert min(np.linalg.norm(p - truth.p) for p in by_algebra) < 1e-3


def test_three_spots_have_up_to_four_poses_and_the_true_one_is_among_them():
    truth = truth_at(np.random.default_rng(2))
    normalised = CAMERA.normalised(truth.pixels())
    poses = pnp.starts(LEDS_IN_B[:3], normalised[:3])
    assert 1 <= len(poses) <= 4
    assert min(np.linalg.norm(p - truth.p) for p, _ in poses) < 1e-3


def test_the_covariance_is_the_scatter_of_repeated_measurements():
    rng = np.random.default_rng(4)
    truth, sigma = truth_at(rng), 0.3
    start = truth.p, truth.R
    fits = [solved(truth, rng.normal(0.0, sigma, (5, 2)), sigma, guess=start) for _ in range(500)]
    errors = np.array([error_of(pnp.pose_of(fit, 0.0), truth) for fit in fits])
    claimed = np.sqrt(np.diag(np.linalg.inv(fits[0].information)))
    np.testing.assert_allclose(errors.std(axis=0), claimed, rtol=0.2)


def test_residuals_larger_than_claimed_make_the_pose_less_sure():
    rng = np.random.default_rng(5)
    truth = truth_at(rng)
    noise = rng.normal(0.0, 1.0, (5, 2))
    honest, boasting = solved(truth, noise, 1.0), solved(truth, noise, 0.1)
    sure = np.trace(np.linalg.inv(boasting.information))
    assert np.trace(pnp.pose_of(boasting, 0.0).covariance) > 5.0 * sure
    # ... about as unsure as who claimed right from the start
    ratio = np.diag(pnp.pose_of(boasting, 0.0).covariance) / np.diag(
        np.linalg.inv(honest.information)
    )
    assert (ratio > 0.1).all()
    assert (ratio < 5.0).all()


def test_residuals_smaller_than_claimed_make_it_no_surer():
    fit = solved(truth_at(np.random.default_rng(6)))
    covariance = pnp.pose_of(fit, 0.0).covariance
    np.testing.assert_allclose(covariance, np.linalg.inv(fit.information), rtol=1e-6, atol=1e-15)
    assert np.array_equal(covariance, covariance.T)


def test_three_leds_leave_no_residual_to_judge_by():
    fit = solved(truth_at(np.random.default_rng(7)))
    three = replace(fit, residuals_px=fit.residuals_px[:3])
    assert np.isfinite(pnp.pose_of(three, 0.0).covariance).all()


def test_leds_in_one_line_give_no_pose_rather_than_an_exception():
    truth = truth_at(np.random.default_rng(8))
    line = np.outer(np.linspace(-1.0, 1.0, 5), [0.0, 0.3, 0.0])
    normalised = -(truth.p + line)[:, 1:] / (truth.p + line)[:, :1]
    weights = np.tile(np.eye(2), (5, 1, 1))
    fit = pnp.refine(CAMERA, line, normalised, weights, truth.p, np.eye(3))
    assert fit is None or np.isfinite(fit.p_bc_in_c).all()
    same = np.zeros((5, 3))
    assert pnp.refine(CAMERA, same, normalised[[2] * 5], weights, truth.p, np.eye(3)) is None


def test_a_pose_behind_the_camera_is_none():
    truth = truth_at(np.random.default_rng(9))
    assert solved(truth, guess=(-truth.p, truth.R)) is None


def test_rms_is_of_distances_in_the_picture():
    fit = solved(truth_at(np.random.default_rng(10)))
    shifted = replace(fit, residuals_px=np.tile([3.0, 4.0], (5, 1)))
    assert shifted.rms_px == pytest.approx(5.0)
