"""Quaternions are rotations."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pipeline.frames import R_from_wxyz, exp, wxyz_from_R
from pipeline.timing.quaternions import conjugate, matrices, product, small_vectors

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
