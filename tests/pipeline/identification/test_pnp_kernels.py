"""The compiled solver against numpy's algebra and finite differences."""

import numpy as np

from pipeline.frames import exp
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
        chi2 = refine(LEDS_IN_B, flat, shifts, W, F, p, R, information, residuals)
        J = np.empty((5, 2, 6))
        for i, led in enumerate(LEDS_IN_B):
            r, J[i] = residual(led, flat[i], shifts[i], p, R)
            np.testing.assert_allclose(residuals[i], r, atol=1e-9)
        JW = J.transpose(0, 2, 1) @ W
        np.testing.assert_allclose(information, (JW @ J).sum(axis=0), rtol=1e-9, atol=1e-6)
        slope = np.einsum("ijk,ik->j", JW, residuals)
        assert np.abs(np.linalg.solve(information, slope)).max() < 1e-6
        assert np.isclose(chi2, np.einsum("ij,ijk,ik->", residuals, W, residuals))
