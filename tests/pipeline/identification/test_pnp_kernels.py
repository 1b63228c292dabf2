"""The compiled solver against numpy's algebra and finite differences."""

import numpy as np
from scipy.optimize import least_squares

from pipeline.frames import exp, log
from pipeline.identification.pnp_kernels import put_residual, refine
from tests.pipeline.seeing import LEDS_IN_B, truth_at

F = 900.0


def residual(led, flat, shift, p, R):
    r, J = np.empty(2), np.empty((2, 6))
    assert put_residual(led, flat, shift, F, p, R, r, J)
    return r, J


def test_residual_and_jacobian_are_those_of_a_pinhole():
    rng = np.random.default_rng(3)
    truth, step = truth_at(rng), 1e-6
    for led in LEDS_IN_B:
        flat, shift = rng.normal(0.0, 0.2, 2), rng.normal(0.0, 0.01, 3)
        q = truth.p + shift + truth.R @ led
        r, J = residual(led, flat, shift, truth.p, truth.R)
        np.testing.assert_allclose(r, F * (flat + q[1:] / q[0]), atol=1e-9)
        for k, e in enumerate(step * np.eye(6)):
            ahead, behind = (
                residual(led, flat, shift, truth.p + d[:3], truth.R @ exp(d[3:]))[0]
                for d in (e, -e)
            )
            slope = (ahead - behind) / (2.0 * step)
            np.testing.assert_allclose(J[:, k], -slope, atol=1e-6 * F)  # seen − expected


def test_what_is_not_in_front_has_no_residual():
    r, J = np.empty(2), np.empty((2, 6))
    args = np.zeros(3), np.zeros(2), np.zeros(3), F
    assert not put_residual(*args, np.array([-1.0, 0.0, 0.0]), np.eye(3), r, J)


def test_the_answer_minimises_chi2_and_its_information_is_the_curvature():
    rng = np.random.default_rng(5)
    for _ in range(5):
        truth = truth_at(rng)
        shifts = rng.normal(0.0, 0.005, (5, 3))
        q = truth.p + shifts + LEDS_IN_B @ truth.R.T
        flat = -q[:, 1:] / q[:, :1] + rng.normal(0.0, 0.3 / F, (5, 2))
        W = np.array([np.linalg.inv(c @ c.T) for c in rng.normal(0.0, 0.3, (5, 2, 3))])
        p, R = truth.p * 1.03, truth.R @ exp(rng.normal(0.0, 0.05, 3))
        information, residuals = np.empty((6, 6)), np.empty((5, 2))
        still = np.zeros(5), 0.5
        chi2 = refine(LEDS_IN_B, flat, shifts, W, *still, F, p, R, information, residuals)
        J = np.empty((5, 2, 6))
        for i, led in enumerate(LEDS_IN_B):
            r, J[i] = residual(led, flat[i], shifts[i], p, R)
            np.testing.assert_allclose(residuals[i], r, atol=1e-9)
        JW = J.transpose(0, 2, 1) @ W
        np.testing.assert_allclose(information, (JW @ J).sum(axis=0), rtol=1e-9, atol=1e-6)
        slope = np.einsum("ijk,ik->j", JW, residuals)
        assert np.abs(np.linalg.solve(information, slope)).max() < 1e-6
        assert np.isclose(chi2, np.einsum("ij,ijk,ik->", residuals, W, residuals))


def rolled(rng, sigma_u, noise_px=0.02):
    """Five LEDs by the times of their rows, carried by a velocity that is wrong by `sigma_u`."""
    truth, delays = truth_at(rng), rng.uniform(-0.01, 0.01, 5)
    u, known = rng.normal(0.0, 0.3, 3), np.full((5, 2, 2), np.eye(2) / noise_px**2)
    q = truth.p + delays[:, None] * u + LEDS_IN_B @ truth.R.T
    flat = -q[:, 1:] / q[:, :1] + rng.normal(0.0, noise_px / F, (5, 2))
    return truth, flat, delays[:, None] * (u + rng.normal(0.0, sigma_u, 3)), known, delays


def solved(sight, sigma_u):
    truth, flat, shifts, W, delays = sight
    p, R = truth.p.copy(), truth.R.copy()
    information, residuals = np.empty((6, 6)), np.empty((5, 2))
    chi2 = refine(LEDS_IN_B, flat, shifts, W, delays, sigma_u, F, p, R, information, residuals)
    return chi2, p, R, information, residuals


def test_a_velocity_that_is_known_so_well_is_an_unknown_with_a_prior():
    rng, sigma_u = np.random.default_rng(7), 0.05
    for _ in range(5):
        sight = rolled(rng, sigma_u)
        chi2, p, R, information, residuals = solved(sight, sigma_u)
        _, flat, shifts, W, delays = sight

        def errors(x, p=p, R=R, flat=flat, shifts=shifts, W=W, delays=delays):
            q = p + x[:3] + shifts + delays[:, None] * x[6:] + LEDS_IN_B @ (R @ exp(x[3:6])).T
            px = F * (flat + q[:, 1:] / q[:, :1])
            return np.concatenate((np.sqrt(W[0, 0, 0]) * px.ravel(), x[6:] / sigma_u))

        best = least_squares(
            errors, np.zeros(9), x_scale=np.repeat((1e-3, 1e-3, 0.05), 3), xtol=1e-14
        )
        assert np.isclose(chi2, 2.0 * best.cost, rtol=1e-3)  # the kernel is linear in a velocity
        assert np.abs(best.x[:6]).max() < 1e-5  # the pose found is the best one
        np.testing.assert_allclose(
            residuals.ravel(), best.fun[:10] / np.sqrt(W[0, 0, 0]), atol=1e-4
        )
        of_pose = np.linalg.inv(best.jac.T @ best.jac)[:6, :6]
        np.testing.assert_allclose(np.linalg.inv(information), of_pose, rtol=1e-2, atol=1e-11)


def test_by_a_velocity_known_badly_poses_are_as_good_as_they_say_and_better_than_if_it_is_trusted():
    rng, sigma_u, n = np.random.default_rng(9), 0.05, 400
    chi2s, nees, off = np.zeros(n), np.zeros(n), np.zeros((n, 2))
    for k in range(n):
        sight = rolled(rng, sigma_u)
        truth = sight[0]
        for way, claimed in enumerate((sigma_u, 0.0)):
            chi2, p, R, information, _ = solved(sight, claimed)
            e = np.concatenate((p - truth.p, log(truth.R.T @ R)))
            off[k, way] = e[0]
            if way == 0:
                chi2s[k], nees[k] = chi2, e @ information @ e
    assert abs(chi2s.mean() - 4.0) < 4.0 * np.sqrt(8.0 / n)  # 2 x 5 + 3 known, 9 unknown
    assert abs(nees.mean() - 6.0) < 4.0 * np.sqrt(12.0 / n)
    with_prior, trusting = np.sqrt((off**2).mean(axis=0))
    assert with_prior < 0.8 * trusting, (with_prior, trusting)
