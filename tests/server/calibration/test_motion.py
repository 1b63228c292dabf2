"""Rates of views from their neighbours, as far as those tell more than is known of any hand."""

from __future__ import annotations

import numpy as np

from server.calibration.motion import UNKNOWN, rates

SIGMA = np.array([1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
V = np.array([0.1, -0.05, 0.02])


def moved(t: np.ndarray):
    """Views of a board that moves at `V` [m/s] and does not turn."""
    R = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    return rates(t, R, t[:, None] * V, np.tile(SIGMA, (len(t), 1)))


def test_a_view_between_others_has_their_rate() -> None:
    found = moved(np.arange(5) / 30.0)
    assert found.known.tolist() == [False, True, True, True, False]
    np.testing.assert_allclose(found.value[2], [0.0, 0.0, 0.0, *V], atol=1e-9)
    assert (found.sigma[2] < UNKNOWN).all()


def test_views_that_are_too_near_in_time_to_tell_a_rate_tell_none() -> None:
    found = moved(np.arange(3) / 1_000.0)
    assert not found.known.any()
    assert (found.value == 0.0).all()
    assert (found.sigma == UNKNOWN).all()


def test_views_too_far_apart_in_time_tell_none() -> None:
    assert not moved(np.arange(5) / 5.0).known.any()
