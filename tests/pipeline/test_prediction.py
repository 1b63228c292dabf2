"""Expectation: what the filter said for the time of a picture, and nothing it did not say."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.frames import exp
from pipeline.imu_stream import MAX_GAP_S
from pipeline.prediction import REMEMBERED_S, Prediction, PredictionHistory
from pipeline.signals import RelativeState

OMEGA, U, P = np.array([0.2, -0.5, 0.3]), np.array([0.4, 0.1, -0.2]), np.array([2.5, 0.1, 0.0])


def said(t, sigma_p=0.01):
    return Prediction(t, P + t * U, exp(t * OMEGA), U, sigma_p, 0.02)


def filled(times):
    expectation = PredictionHistory()
    for t in times:
        expectation.add(said(t))
    return expectation


def test_between_two_predictions_it_is_on_the_way_from_one_to_the_other():
    expectation = filled(0.02 * np.arange(10))
    for t in (0.0, 0.013, 0.1, 0.18):
        expected = expectation.at(t)
        np.testing.assert_allclose(expected.p_bc_in_c, P + t * U, atol=1e-12)
        np.testing.assert_allclose(expected.R_cb, exp(t * OMEGA), atol=1e-12)
        np.testing.assert_allclose(expected.u_bf_in_c, U)
        assert (expected.t, expected.sigma_p, expected.sigma_theta) == (t, 0.01, 0.02)


def test_it_is_as_unsure_as_the_worse_of_its_neighbours():
    expectation = PredictionHistory()
    expectation.add(said(0.0, sigma_p=0.01))
    expectation.add(said(0.02, sigma_p=0.05))
    assert expectation.at(0.001).sigma_p == 0.05


@pytest.mark.parametrize("t", [-0.001, 0.1801, 5.0])
def test_outside_of_what_was_said_it_says_nothing(t):
    assert filled(0.02 * np.arange(10)).at(t) is None
    assert PredictionHistory().at(t) is None


def test_a_silence_is_not_bridged():
    expectation = filled([0.0, 1.5 * MAX_GAP_S])
    assert expectation.at(0.5 * MAX_GAP_S) is None
    assert expectation.at(1.5 * MAX_GAP_S) is not None


def test_it_forgets_after_a_second():
    expectation = filled(0.02 * np.arange(200))
    last = 0.02 * 199
    assert expectation.at(last - REMEMBERED_S - 0.03) is None
    assert expectation.at(last - REMEMBERED_S + 0.03) is not None


def test_what_a_filter_said_before_it_was_lost_is_void():
    expectation = filled(0.02 * np.arange(10))
    expectation.add(None)
    assert expectation.at(0.1) is None
    expectation.add(said(0.2))
    assert expectation.at(0.19) is None
    assert expectation.at(0.2) is not None


def test_a_filter_whose_time_goes_back_is_another_one():
    expectation = filled([0.0, 0.02, 0.04])
    expectation.add(said(0.03))
    assert expectation.at(0.02) is None
    assert expectation.at(0.03) is not None


def test_a_picture_stamped_wrong_is_expected_where_it_was_taken():
    expectation = PredictionHistory()
    for t in 0.02 * np.arange(10):
        expectation.add(replace(said(t), time_offset=-0.03))
    expected = expectation.at(0.1)
    assert expected.t == pytest.approx(0.07)
    np.testing.assert_allclose(expected.p_bc_in_c, P + 0.07 * U, atol=1e-12)


@pytest.mark.parametrize(("offset", "used"), [(0.01, 0.01), (np.nan, 0.0)])
def test_a_filters_state_is_a_prediction_for_its_time(offset, used):
    state = RelativeState(
        t=3.0,
        p_bc_in_c=P,
        R_cb=exp(OMEGA),
        u_bf_in_c=U,
        omega_bf_in_b=OMEGA,
        omega_cf_in_c=OMEGA,
        R_ic=np.eye(3),
        f_cf_in_c=U,
        f_bf_in_b=U,
        sigma_p=0.01,
        sigma_theta=0.02,
        age=0.1,
    )
    expected = Prediction.of(state, offset)
    assert (expected.t, expected.sigma_p, expected.sigma_theta) == (3.0, 0.01, 0.02)
    assert expected.time_offset == used
    for name in ("p_bc_in_c", "R_cb", "u_bf_in_c"):
        assert getattr(expected, name) is getattr(state, name)
