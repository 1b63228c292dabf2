"""Poses of three points: the true one is among them, also where noise split a pair of roots."""

import numpy as np
import pytest

from pipeline.frames import exp
from pipeline.identification.p3p_kernels import p3p, put_triad, quartic_roots


def roots_of(polynomial, split):
    roots = np.empty(4)
    count = quartic_roots(np.ascontiguousarray(polynomial[::-1]), split, roots)
    return np.sort(roots[:count])


def poses_of(rays, points, split):
    triad, ps, Rs = np.empty((3, 3)), np.empty((4, 3)), np.empty((4, 3, 3))
    put_triad(*points, triad)  # type: ignore[call-arg]
    count = p3p(rays, points, triad, split, ps, Rs)
    return ps[:count], Rs[:count]


def test_real_roots_are_those_of_numpy():
    rng = np.random.default_rng(1)
    for _ in range(50):
        polynomial = rng.normal(0.0, 1.0, 5)
        wanted = np.roots(polynomial)
        wanted = np.sort(wanted[wanted.imag == 0.0].real)
        np.testing.assert_allclose(roots_of(polynomial, 0.0), wanted, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(("apart", "nearly"), [(1e-3, 4), (1.0, 2)])
def test_of_a_pair_that_is_split_too_far_nothing_counts(apart, nearly):
    polynomial = np.poly([2.0, -1.0, 1.5 + 1j * apart, 1.5 - 1j * apart])
    assert len(roots_of(polynomial, 0.0)) == 2
    assert len(roots_of(polynomial, 0.02)) == nearly
    np.testing.assert_allclose(roots_of(polynomial, np.inf), [-1.0, 1.5, 1.5, 2.0], atol=1e-6)


def test_the_true_pose_is_among_them():
    rng = np.random.default_rng(2)
    for split in (0.02, np.inf):
        for _ in range(50):
            points, R = rng.normal(0.0, 0.2, (3, 3)), exp(rng.normal(0.0, 1.0, 3))
            p = np.array([2.0, *rng.normal(0.0, 0.5, 2)])
            q = p + points @ R.T
            ps, Rs = poses_of(q / np.linalg.norm(q, axis=1)[:, None], points, split)
            off = np.abs(ps - p).max(axis=1) + np.abs(Rs - R).max(axis=(1, 2))
            assert off.min() < 1e-4


def test_three_points_in_one_line_give_no_finite_pose():
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.3, 0.0, 0.0]])
    q = points + np.array([2.0, 0.1, 0.2])
    ps, _ = poses_of(q / np.linalg.norm(q, axis=1)[:, None], points, np.inf)
    assert not np.isfinite(ps).any()
