"""Compiled statistics of a picture's pose beside their formulas in numpy."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.estimation.innovation_kernels import lateness, normalised, share_of
from pipeline.estimation.picture_kernels import (
    pose_in_picture,
    pose_rate,
    put_chi2,
    put_corrections,
)
from pipeline.estimation.relative_kernels import BIASES, OFFSET
from pipeline.frames import cross, exp

UNITS = np.repeat((1e-2, 1e-3, 1e-1, 1e-3, 1e-2, 1e-3, 1e-2), (3, 3, 3, 3, 3, 3, 4))
"""Standard deviations as a flight's are, of P (22, 22)."""
NOT_DEFINITE = np.diag((1.0, 1.0, -1.0, 1.0, 1.0, 1.0))


@pytest.fixture(params=range(5))
def rng(request):
    return np.random.default_rng(request.param)


def covariance(rng, n=6):
    A = rng.normal(size=(n, n + 3)) * UNITS[:n, None]
    return A @ A.T


def test_chi2_and_share(rng):
    P, C = covariance(rng), covariance(rng)
    e, S = rng.normal(size=6) * UNITS[:6], P + C
    assert_allclose(normalised(e, S), e @ np.linalg.solve(S, e) / 6.0, rtol=1e-9)
    assert_allclose(share_of(P, S), np.trace(np.linalg.solve(S, P)) / 6.0, rtol=1e-9)
    assert normalised(e, NOT_DEFINITE) == inf
    assert share_of(P, NOT_DEFINITE) == 0.0


def test_how_late_it_seems_is_the_best_fit_along_its_motion(rng):
    e, S, a = rng.normal(size=6) * UNITS[:6], covariance(rng), rng.normal(size=6)
    late_s, information, across = lateness(e, S, a)
    assert_allclose(information, a @ np.linalg.solve(S, a), rtol=1e-9)
    assert_allclose(late_s, a @ np.linalg.solve(S, e) / information, rtol=1e-9)
    left = e - late_s * a
    assert_allclose(across, left @ np.linalg.solve(S, left), rtol=1e-6)
    assert lateness(e, NOT_DEFINITE, a)[1] == 0.0
    assert not lateness(e, S, np.zeros(6))[1] > 0.0


@pytest.mark.parametrize("most", [0.1, 1e9])
def test_corrections_of_biases_are_the_kalman_gain_s(rng, most):
    P = covariance(rng, 22)
    S = P[:6, :6] + covariance(rng)
    e = rng.normal(size=6) * UNITS[:6]
    shift, reduction, chi2 = np.empty((4, 3)), np.empty((4, 3, 3)), np.empty(4)
    surprise = put_corrections(e, S, P, most, shift, reduction)
    assert_allclose(surprise, e @ np.linalg.solve(S, e) / 6.0, rtol=1e-9)
    gain = P[BIASES:OFFSET, :6] @ np.linalg.inv(S)
    cut = min(1.0, np.sqrt(most / surprise))
    assert_allclose(shift.ravel(), cut * gain @ e, rtol=1e-6, atol=1e-12)
    lowered = gain @ P[:6, BIASES:OFFSET]
    for k in range(4):
        own = slice(3 * k, 3 * k + 3)
        assert_allclose(reduction[k], lowered[own, own], rtol=1e-6, atol=1e-14)
    put_chi2(shift, reduction, chi2)
    expected = [s @ np.linalg.solve(V, s) / 3.0 for s, V in zip(shift, reduction, strict=True)]
    assert_allclose(chi2, expected, rtol=1e-5)
    assert put_corrections(e, NOT_DEFINITE, P, most, shift, reduction) == inf


def test_a_picture_s_doubtful_date_is_a_doubt_of_its_pose(rng):
    P, a = covariance(rng, 22), rng.normal(size=6)
    touched = [*range(6), OFFSET]
    seen = np.column_stack((np.eye(6), a))
    assert_allclose(pose_in_picture(P, a), seen @ P[np.ix_(touched, touched)] @ seen.T, rtol=1e-9)


def test_a_pose_passes_by_both_motions(rng):
    x, R, inputs = rng.normal(size=19), exp(rng.normal(size=3)), rng.normal(size=12)
    told = rng.normal(size=4)
    rate = pose_rate(x, R, inputs, told)
    assert_allclose(rate[:3], x[3:6] + told[:3] - cross(inputs[6:9], x[:3]))
    assert_allclose(rate[3:], inputs[:3] - R.T @ inputs[6:9])
