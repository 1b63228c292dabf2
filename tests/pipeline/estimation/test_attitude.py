"""Attitude: level from gravity, turned by the gyroscope, its bias learnt."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.sim.hand import make_hand
from pipeline.estimation.attitude import HAND_RATE, HAND_RATE_S, LOST_S, Attitude
from pipeline.frames import GRAVITY, exp, log, rotation_about_z
from pipeline.signals import PhoneImu

DT = 1 / 60
UP = np.array([0.0, 0.0, 1.0])


def sample(t: float, R_fc: np.ndarray, omega: np.ndarray) -> PhoneImu:
    return PhoneImu(t, omega, R_fc.T @ (GRAVITY * UP))


def test_the_first_sample_at_rest_gives_the_tilt() -> None:
    R_fc = exp(np.array([0.3, -0.8, 0.0]))
    attitude = Attitude()
    assert attitude.R_fc is None
    attitude.add(sample(0.0, R_fc, np.zeros(3)))
    assert attitude.up_in_c is not None
    np.testing.assert_allclose(attitude.up_in_c, R_fc.T @ UP, atol=1e-12)


def test_follows_a_turn_upright_where_browsers_angles_are_singular() -> None:
    attitude, R_fc = Attitude(), np.eye(3)
    omega = np.array([0.2, 1.0, 0.5])
    attitude.add(sample(0.0, R_fc, omega))
    for k in range(1, 300):
        R_fc = R_fc @ exp(omega * DT)
        attitude.add(sample(k * DT, R_fc, omega))
    assert attitude.R_fc is not None
    assert np.linalg.norm(log(attitude.R_fc.T @ R_fc)) < 1e-6


def test_learns_a_tilt_bias_and_keeps_level() -> None:
    attitude, bias = Attitude(), np.array([0.01, -0.008, 0.0])
    for k in range(60 * 120):
        attitude.add(sample(k * DT, np.eye(3), bias))
    assert attitude.up_in_c is not None
    assert np.linalg.norm(attitude.up_in_c - UP) < 0.01
    np.testing.assert_allclose(attitude.bias_omega, bias, atol=2e-3)


def test_free_fall_and_shocks_do_not_tilt_it() -> None:
    attitude = Attitude()
    attitude.add(sample(0.0, np.eye(3), np.zeros(3)))
    for k in range(1, 60):
        attitude.add(PhoneImu(k * DT, np.zeros(3), np.array([40.0 * (k % 2), 0.0, 0.1])))
    np.testing.assert_allclose(attitude.up_in_c, UP, atol=1e-9)


def test_old_samples_are_ignored_and_a_long_gap_starts_anew() -> None:
    attitude = Attitude()
    attitude.add(sample(1.0, np.eye(3), np.zeros(3)))
    attitude.add(sample(0.5, rotation_about_z(1.0), np.array([9.0, 9.0, 9.0])))
    np.testing.assert_allclose(attitude.R_fc, np.eye(3), atol=1e-12)
    turned = exp(np.array([0.5, 0.0, 0.0]))
    attitude.add(PhoneImu(1.1 + LOST_S, np.zeros(3), np.zeros(3)))  # falls: says no tilt
    np.testing.assert_allclose(attitude.R_fc, np.eye(3), atol=1e-12)
    attitude.add(sample(1.2 + LOST_S, turned, np.zeros(3)))
    assert attitude.resets == 1
    np.testing.assert_allclose(attitude.up_in_c, turned.T @ UP, atol=1e-12)


def rested(seconds: float) -> Attitude:
    attitude = Attitude()
    for k in range(round(seconds / DT) + 1):
        attitude.add(sample(k * DT, np.eye(3), np.zeros(3)))
    return attitude


def test_a_gaps_first_sample_of_a_hand_that_accelerates_is_not_believed_alone() -> None:
    attitude = rested(10.0)
    attitude.add(PhoneImu(10.5, np.zeros(3), np.array([3.0, 0.0, GRAVITY])))
    assert attitude.up_in_c is not None
    assert np.linalg.norm(attitude.up_in_c - UP) < 0.03
    assert attitude.sigma > 0.05


def test_a_turn_in_a_gap_is_inferred_from_both_ends() -> None:
    attitude = Attitude()
    for k in range(61):
        attitude.add(sample(k * DT, rotation_about_z(k * DT), np.array([0.0, 0.0, 1.0])))
    attitude.add(sample(1.12, rotation_about_z(1.12), np.array([0.0, 0.0, 1.0])))
    assert attitude.R_fc is not None
    assert np.linalg.norm(log(attitude.R_fc.T @ rotation_about_z(1.12))) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("gap_s", [0.25, 0.5, 0.9])
def test_its_sigma_is_that_of_its_tilt_after_a_gap(gap_s: float) -> None:
    """A hand as it is assumed to be: rates and accelerations, each with its correlation time."""
    rng, h, squares = np.random.default_rng(3), 0.005, []
    for _ in range(150):
        attitude, R_fc, t = Attitude(), np.eye(3), 0.0
        omega, a_in_f = HAND_RATE * rng.normal(size=3), 1.5 * rng.normal(size=3)
        while t < 3.3 + gap_s:
            if t < 3.0 or t > 3.0 + gap_s:
                attitude.add(PhoneImu(t, omega, R_fc.T @ (GRAVITY * UP + a_in_f)))
            if attitude.up_in_c is not None and t > 3.0 + gap_s:
                off = attitude.up_in_c - R_fc.T @ UP
                squares.append(float(off @ off) / (2.0 * attitude.sigma**2))
                break
            R_fc, t = R_fc @ exp(omega * h), t + h
            keep = np.exp(-h / HAND_RATE_S)
            fresh = np.sqrt(1.0 - keep * keep)
            omega = keep * omega + fresh * HAND_RATE * rng.normal(size=3)
            a_in_f = keep * a_in_f + fresh * 1.5 * rng.normal(size=3)
    assert 0.5 < np.mean(squares) < 1.5


def test_a_changing_rate_is_followed_to_second_order() -> None:
    """A tremor at 9 Hz, sampled at 60 Hz: rectangles would lag by half a sample."""
    attitude, w = Attitude(), 2.0 * np.pi * 9.0
    errors = []
    for k in range(600):
        t = k * DT
        angle, rate = 0.01 * np.sin(w * t), 0.01 * w * np.cos(w * t)
        attitude.add(sample(t, rotation_about_z(angle), np.array([0.0, 0.0, rate])))
        assert attitude.R_fc is not None
        errors.append(log(attitude.R_fc)[2] - angle)
    assert np.std(errors[60:]) < 0.1 * 0.01


def test_the_first_second_is_averaged_not_the_first_sample_believed() -> None:
    attitude = Attitude()
    for k in range(61):  # a hand that shakes by 1 m/s² at 2 Hz
        shake = np.array([np.cos(4.0 * np.pi * k * DT), 0.0, 0.0])
        attitude.add(PhoneImu(k * DT, np.zeros(3), GRAVITY * UP + shake))
    assert attitude.up_in_c is not None
    assert np.linalg.norm(attitude.up_in_c - UP) < 0.02


def test_what_the_accelerometer_turns_is_told_apart_from_what_the_gyroscope_felt() -> None:
    attitude, rate = Attitude(), np.array([0.1, -0.2, 0.3])
    attitude.add(sample(0.0, np.eye(3), rate))
    turned, R_felt = np.eye(3), np.eye(3)
    for k in range(1, 60):
        R_felt = R_felt @ exp((rate - attitude.bias_omega) * DT)
        pushed = np.array([2.0, 0.0, GRAVITY])  # a hand that starts to move
        attitude.add(PhoneImu(k * DT, rate, R_felt.T @ pushed))
        turned = attitude.take_turn() @ turned
        assert attitude.R_fc is not None
        np.testing.assert_allclose(attitude.R_fc, turned @ R_felt, atol=1e-9)
    assert np.linalg.norm(log(turned)) > 0.02
    np.testing.assert_array_equal(attitude.take_turn(), np.eye(3))


def test_after_a_long_gap_the_heading_stays() -> None:
    attitude = Attitude()
    rate = np.array([0.0, 0.0, 1.0])
    R_fc = np.eye(3)
    for k in range(61):
        R_fc = rotation_about_z(k * DT)
        attitude.add(sample(k * DT, R_fc, rate))
    later = R_fc @ exp(np.array([0.1, 0.0, 0.0]))
    attitude.add(sample(1.1 + LOST_S, later, np.zeros(3)))
    assert attitude.R_fc is not None
    assert np.linalg.norm(log(attitude.R_fc.T @ later)) < 0.01


def test_who_knows_better_after_a_gap_is_believed_as_far_as_he_knows() -> None:
    attitude = rested(10.0)
    before, R_fc = attitude.sigma, exp(np.array([0.2, -0.1, 0.3]))
    attitude.add(sample(10.5, R_fc, np.zeros(3)))
    attitude.correct(R_fc, before)
    np.testing.assert_array_equal(attitude.R_fc, R_fc)
    assert attitude.sigma == pytest.approx(before)
    np.testing.assert_array_equal(attitude.take_turn(), np.eye(3))


@pytest.mark.parametrize("turn_deg", [20.0, 33.0, 120.0])
def test_a_turn_that_the_gyroscope_missed_is_found_by_the_accelerometer(turn_deg: float) -> None:
    attitude = rested(5.0)
    turned = exp(np.array([np.deg2rad(turn_deg), 0.0, 0.0]))
    for k in range(1, round(2.0 / DT)):
        attitude.add(sample(5.0 + k * DT, turned, np.zeros(3)))
    assert attitude.up_in_c is not None
    assert np.rad2deg(np.linalg.norm(attitude.up_in_c - turned.T @ UP)) < 3.0


@pytest.mark.parametrize("kind", ["walking", "shaken", "put_down", "restless", "trembling_6_hz"])
def test_no_hand_is_taken_for_a_turn_that_was_missed(kind: str) -> None:
    hand, attitude = make_hand(kind, seed=4), Attitude()
    sigmas = []
    for k in range(round(40.0 / DT)):
        t = k * DT
        attitude.add(PhoneImu(t, hand.omega_in_c(t), hand.specific_force_in_c(t)))
        sigmas.append(attitude.sigma)
    assert np.max(sigmas[round(10.0 / DT) :]) == pytest.approx(sigmas[-1])  # never anew
