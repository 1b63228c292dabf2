"""Compiled linear algebra agrees with numpy."""

import numpy as np

from pipeline.linear_kernels import cholesky, solve_by


def test_cholesky_and_solve_are_those_of_numpy():
    rng = np.random.default_rng(4)
    for n in (2, 6):
        A = rng.normal(0.0, 1.0, (n, n + 2))
        A, b = A @ A.T, rng.normal(0.0, 1.0, n)
        L, x = A.copy(), b.copy()
        assert cholesky(L, 0.0)
        np.testing.assert_allclose(np.tril(L), np.linalg.cholesky(A), atol=1e-12)
        solve_by(L, x)
        np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=1e-9)
    assert not cholesky(np.diag([1.0, 0.0]), 0.0)
    assert not cholesky(np.diag([1.0, np.nan]), 0.0)


def test_only_with_a_floor_does_the_scale_matter():
    tiny = np.diag([1.0, 1e-13])
    assert cholesky(tiny.copy(), 0.0)
    assert not cholesky(tiny.copy(), 1.0)
    nearly_singular = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-13]])
    for scale in (1e-9, 1.0, 1e9):
        assert not cholesky(scale * nearly_singular, 0.0)


def test_only_the_lower_half_is_read_and_written():
    A = np.array([[4.0, np.nan], [2.0, 5.0]])
    assert cholesky(A, 0.0)
    np.testing.assert_array_equal(A, [[2.0, np.nan], [1.0, 2.0]])
