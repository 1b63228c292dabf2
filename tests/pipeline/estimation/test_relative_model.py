"""The paper's equations against a numerically differentiated truth, and the Jacobian."""

from functools import cache

import numpy as np
import pytest

from pipeline.estimation.relative_model import (
    H_BODY,
    H_PHONE,
    H_POSE,
    N,
    States,
    derivative,
    jacobian,
    measurement,
    pose_covariance_in_rpy,
    rk4_step,
    transition,
)
from pipeline.frames import R_from_rpy, S_in_a, S_in_b, cross, rpy_from_R, skew
from tests.pipeline.moving import H, eta_bc, imu_of, p_bc_in_c, pose_in_f, rate, second_rate, worst


@cache
def true_state(t):
    x = np.zeros(N)
    _, omega_c, delta_c, f_c = imu_of(0, t)
    _, omega_b, _, f_b = imu_of(1, t)
    x[States.p_bc_in_c], x[States.eta_bc] = p_bc_in_c(t), eta_bc(t)
    x[States.v_bc_in_c] = rate(p_bc_in_c, t)
    x[States.omega_bf_in_b], x[States.omega_cf_in_c] = omega_b, omega_c
    x[States.a_bf_in_b], x[States.a_cf_in_c], x[States.delta_cf_in_c] = f_b, f_c, delta_c
    x.setflags(write=False)
    return x


def test_rates_of_rpy_agree_with_the_truth():
    """Eq. (3), (7): η̇ = ^bS⁻¹(ω_b − ^bR_c ω_c)."""
    part = States.eta_bc
    assert worst(lambda t: derivative(true_state(t))[part] - rate(eta_bc, t)) < 1e-9


def test_rates_of_rpy_with_S_of_the_wrong_frame_fail():
    def residual(t):
        x = true_state(t)
        omega = x[States.omega_bf_in_b] - R_from_rpy(eta_bc(t)).T @ x[States.omega_cf_in_c]
        return np.linalg.solve(S_in_a(eta_bc(t)), omega) - rate(eta_bc, t)

    assert worst(residual) > 0.3


def test_relative_acceleration_agrees_with_the_truth_gravity_left_in():
    """Eq. (8), every term in c, raw specific forces: gravity cancels."""
    part = States.v_bc_in_c
    assert worst(lambda t: derivative(true_state(t))[part] - second_rate(p_bc_in_c, t)) < 1e-9


def test_relative_acceleration_as_printed_in_mixed_axes_fails():
    """Eq. (8) with the state's ^b a_{b/f} not turned into c."""

    def residual(t):
        x = true_state(t)
        turned = R_from_rpy(eta_bc(t)) @ x[States.a_bf_in_b] - x[States.a_bf_in_b]
        return derivative(x)[States.v_bc_in_c] - turned - second_rate(p_bc_in_c, t)

    assert worst(residual) > 3.0


def test_absolute_attitude_of_the_body_and_the_printed_reading_of_it():
    """Eq. (12): ^fR_b = ^fR_c ^cR_b(η_{b/c}); its printed inverse is far off."""

    def residual(t, printed):
        R_cb = R_from_rpy(eta_bc(t))
        return pose_in_f(0, t)[1] @ (R_cb.T if printed else R_cb) - pose_in_f(1, t)[1]

    assert worst(lambda t: residual(t, printed=False)) < 1e-14
    assert worst(lambda t: residual(t, printed=True)) > 0.7


def test_camera_rate_and_held_quantities():
    """Eq. (11): ω̇_c = δ_c as seen from c; the rest is constant."""
    part = States.omega_cf_in_c
    assert (
        worst(lambda t: derivative(true_state(t))[part] - rate(lambda s: imu_of(0, s)[1], t)) < 1e-9
    )
    assert np.array_equal(derivative(true_state(1.0))[15:], np.zeros(15))


def test_velocity_seen_from_f_is_v_plus_omega_cross_p():
    def residual(t):
        x, (_, R_fc) = true_state(t), pose_in_f(0, t)
        u = R_fc.T @ rate(lambda s: pose_in_f(1, s)[0] - pose_in_f(0, s)[0], t)
        return x[States.v_bc_in_c] + cross(x[States.omega_cf_in_c], x[States.p_bc_in_c]) - u

    assert worst(residual) < 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_the_jacobian_is_the_derivative_of_the_derivative(seed):
    x = np.random.default_rng(seed).normal(size=N)
    x[4] = (-1.5, -1.0, 0.0, 1e-9, 0.7, 1.2, 1.4, 1.5)[seed]
    h = 2e-3 * np.cos(x[4])
    columns = [rate(lambda s, e=e: derivative(x + h / H * s * e), 0.0) * H / h for e in np.eye(N)]
    F = jacobian(x)
    assert np.abs(F - np.array(columns).T).max() < 1e-8 * max(1.0, np.abs(F).max())
    assert np.count_nonzero(F) <= 81


def test_runge_kutta_is_of_fourth_order():
    x = true_state(2.0).copy()
    fine = x
    for _ in range(64):
        fine = rk4_step(fine, 0.1 / 64)
    half = rk4_step(rk4_step(x, 0.05), 0.05)
    ratio = np.abs(rk4_step(x, 0.1) - fine).max() / np.abs(half - fine).max()
    assert 12.0 < ratio < 20.0


def test_the_transition_is_the_derivative_of_a_step_to_second_order():
    x, e = true_state(3.0), 1e-5

    def error(h):
        columns = [(rk4_step(x + e * u, h) - rk4_step(x - e * u, h)) / (2.0 * e) for u in np.eye(N)]
        return np.abs(np.array(columns).T - transition(x, h)).max()

    assert error(0.005) < 2e-4
    assert error(0.02) / error(0.01) > 3.5


def test_measurements_are_sums_of_states():
    x = np.arange(float(N))
    y = measurement(x)
    assert np.array_equal(y[:6], H_POSE @ x)
    assert np.array_equal(y[6:9], x[9:12] + x[24:27])
    assert np.array_equal(y[9:12], x[12:15])
    assert np.array_equal(y[12:15], x[15:18] + x[27:30])
    assert np.array_equal(y[15:], x[18:21])
    assert H_BODY.sum() == 12.0
    assert H_PHONE.sum() == 6.0


def test_the_pose_covariance_is_that_of_sampled_poses():
    eta, sigma = np.array([0.4, 1.1, -2.0]), 1e-3
    draws = np.random.default_rng(1).normal(0.0, sigma, (4000, 3))
    R = R_from_rpy(eta)
    moved = np.array([rpy_from_R(R @ (np.eye(3) + skew(theta))) for theta in draws]) - eta
    C = pose_covariance_in_rpy(eta, sigma**2 * np.eye(6))[3:, 3:]
    assert np.abs(np.cov(moved.T) - C).max() < 0.08 * C.max()
    assert np.abs(S_in_b(eta) @ C @ S_in_b(eta).T - sigma**2 * np.eye(3)).max() < 1e-15


def test_the_slices_cover_the_state_once():
    parts = [
        value for name, value in vars(States).items() if isinstance(value, slice) and name != "pose"
    ]
    covered = np.concatenate([np.arange(N)[part] for part in parts])
    assert np.array_equal(covered, np.arange(N))
