"""Compiled rotations agree with `frames` and numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.frames import exp, skew
from pipeline.so3_kernels import (
    largest_sigma,
    multiply,
    put_exp,
    put_right_jacobian,
    times_skew,
    turn,
)

vectors = st.tuples(*[st.floats(-4.0, 4.0)] * 3).map(np.array)


@given(vectors, st.sampled_from((1.0, 1e-3, 1e-5, 1e-9, 0.0)))
def test_exp_is_that_of_frames(v, scale):
    R = np.empty((3, 3))
    put_exp(*(scale * v), R)  # type: ignore[call-arg]
    assert np.abs(R - exp(scale * v)).max() < 1e-13
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-13


def test_products():
    A, B = np.random.default_rng(0).normal(size=(2, 3, 3))
    v, C, w = B[0].copy(), np.empty((3, 3)), np.empty(3)
    multiply(A, B, C)
    assert np.abs(C - A @ B).max() < 1e-14
    turn(A, v, w)
    assert np.abs(w - A @ v).max() < 1e-14
    times_skew(A, v, C)
    assert np.abs(C - A @ skew(v)).max() < 1e-14


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.01, 0.05])
def test_the_right_jacobian_is_that_of_small_turns(angle):
    """Exp(v + δ) = Exp(v) Exp(J δ), to the third order in v."""
    v, J, e = angle * np.array([0.6, -0.48, 0.64]), np.empty((3, 3)), 1e-5
    put_right_jacobian(*v, J)  # type: ignore[call-arg]
    for k, axis in enumerate(np.eye(3)):
        turned = exp(v).T @ (exp(v + e * axis) - exp(v - e * axis)) / (2.0 * e)
        column = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
        assert np.abs(J[:, k] - column).max() < 1e-9 + angle**3 / 20.0


@given(st.integers(0, 10_000), st.floats(-8.0, 8.0), st.booleans())
def test_the_largest_sigma_is_the_largest_eigenvalue(seed, decades, is_round):
    rng = np.random.default_rng(seed)
    A = np.eye(3) if is_round else rng.normal(size=(3, 3))
    C = np.full((7, 7), np.nan)
    C[2:5, 2:5] = 10.0**decades * A @ A.T
    expected = np.sqrt(np.linalg.eigvalsh(C[2:5, 2:5])[-1])
    assert abs(largest_sigma(C, 2) - expected) < 1e-7 * expected


def test_the_largest_sigma_of_certainty_is_zero():
    assert largest_sigma(np.zeros((3, 3)), 0) == 0.0
