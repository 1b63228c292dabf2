"""Attitude: level from gravity, turned by the gyroscope, its bias learnt."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.attitude import Attitude
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


def test_old_samples_are_ignored_and_a_gap_starts_anew() -> None:
    attitude = Attitude()
    attitude.add(sample(1.0, np.eye(3), np.zeros(3)))
    attitude.add(sample(0.5, rotation_about_z(1.0), np.array([9.0, 9.0, 9.0])))
    np.testing.assert_allclose(attitude.R_fc, np.eye(3), atol=1e-12)
    attitude.add(sample(2.0, exp(np.array([0.5, 0.0, 0.0])), np.zeros(3)))
    assert attitude.resets == 1


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


def test_after_a_gap_the_heading_stays() -> None:
    attitude = Attitude()
    rate = np.array([0.0, 0.0, 1.0])
    R_fc = np.eye(3)
    for k in range(61):
        R_fc = rotation_about_z(k * DT)
        attitude.add(sample(k * DT, R_fc, rate))
    attitude.add(sample(3.0, R_fc @ exp(np.array([0.1, 0.0, 0.0])), np.zeros(3)))
    assert attitude.R_fc is not None
    assert np.linalg.norm(log(attitude.R_fc.T @ R_fc @ exp(np.array([0.1, 0.0, 0.0])))) < 0.01
