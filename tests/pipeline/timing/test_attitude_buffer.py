"""Turns: attitudes added up from rates, at any time between samples."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pipeline.frames import R_from_wxyz, exp, log, wxyz_from_R
from pipeline.timing.attitude_buffer import (
    CAPACITY,
    AttitudeBuffer,
    conjugate,
    matrices,
    product,
    small_vectors,
)

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@given(a=vectors, b=vectors)
def test_products_inverses_and_matrices_are_those_of_rotations(a, b):
    q, p = (np.array(wxyz_from_R(exp(v))) for v in (a, b))
    assert_allclose(R_from_wxyz(product(q, p)), exp(a) @ exp(b), atol=1e-12)
    assert_allclose(R_from_wxyz(conjugate(q)), exp(a).T, atol=1e-12)
    assert_allclose(matrices(np.array([q, p])), [exp(a), exp(b)], atol=1e-12)


@given(a=vectors)
def test_small_vectors_are_rotation_vectors(a):
    small = 0.05 * a
    for sign in (1.0, -1.0):
        q = sign * np.array(wxyz_from_R(exp(small)))
        assert_allclose(small_vectors(q), small, atol=2e-5)


def test_a_constant_rate_is_followed_exactly_between_samples():
    turns, omega = AttitudeBuffer(), np.array([0.3, -1.0, 0.5])
    for k in range(100):
        turns.add(0.01 * k, omega)
    t = np.array([0.0, 0.123, 0.9899])
    for q, at in zip(turns.at(t), t, strict=True):
        assert np.linalg.norm(log(R_from_wxyz(q).T @ exp(omega * at))) < 1e-6


def test_a_changing_rate_is_followed_to_second_order():
    turns = AttitudeBuffer()
    for k in range(200):
        turns.add(0.01 * k, np.array([np.sin(3.0 * 0.01 * k), 0.0, 0.0]))
    (q,) = turns.at(np.array([1.5]))
    assert abs(log(R_from_wxyz(q))[0] - (1.0 - np.cos(4.5)) / 3.0) < 1e-4


def test_a_gap_forgets_and_old_samples_are_ignored():
    turns = AttitudeBuffer()
    assert turns.newest == -np.inf
    assert turns.add(0.0, np.zeros(3))
    assert turns.add(0.05, np.ones(3))
    assert turns.add(0.01, 9.0 * np.ones(3))
    assert turns.newest == 0.05
    assert not turns.add(1.0, np.zeros(3))
    assert turns.oldest == turns.newest == 1.0


def test_the_oldest_half_goes_when_there_is_no_room():
    turns = AttitudeBuffer()
    for k in range(CAPACITY + 10):
        turns.add(0.01 * k, np.array([0.1, 0.0, 0.0]))
    assert turns.newest == 0.01 * (CAPACITY + 9)
    first, last = turns.at(np.array([turns.oldest, turns.newest]))
    turned = log(R_from_wxyz(first).T @ R_from_wxyz(last))[0]
    expected = 0.1 * (turns.newest - turns.oldest)
    assert abs((turned - expected + np.pi) % (2.0 * np.pi) - np.pi) < 1e-6
