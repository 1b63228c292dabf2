"""The measure of tracking: what the hand meant, along the axes that are controlled."""

import numpy as np

from hardware.sim.reference_trajectory import missed_by
from pipeline.frames import R_from_rpy, exp

ALL = np.ones(6, dtype=bool)
PLANAR = np.array([True, True, False, False, False, True])


def test_with_all_axes_it_is_the_whole_offset_and_turn():
    R_fr, turn = R_from_rpy(np.array([0.2, -0.1, 1.0])), np.array([0.05, -0.02, 0.1])
    body, p = (R_fr @ exp(turn), np.array([1.0, 2.0, 3.0])), np.array([0.9, 2.2, 3.1])
    offset_in_f, turned = missed_by(body, (R_fr, p), ALL)
    np.testing.assert_allclose(offset_in_f, body[1] - p)
    np.testing.assert_allclose(turned, turn)


def test_axes_that_are_let_alone_miss_nothing():
    R_fb = R_from_rpy(np.array([0.0, 0.0, 0.8]))
    offset_in_b = np.array([0.1, -0.2, 0.5])
    intended = (R_fb @ exp(np.array([0.3, 0.0, 0.0])), -R_fb @ offset_in_b)
    offset_in_f, turned = missed_by((R_fb, np.zeros(3)), intended, PLANAR)
    np.testing.assert_allclose(R_fb.T @ offset_in_f, (0.1, -0.2, 0.0), atol=1e-12)
    np.testing.assert_allclose(turned, 0.0, atol=1e-12)
