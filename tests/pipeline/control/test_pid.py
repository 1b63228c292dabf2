"""Pose error and PID: rates are derivatives, the integral lives in f, wind-up is taken back."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.control.pid import ALL_AXES, BACK_S, Pid, Reference, pose_error
from pipeline.frames import cross, exp
from pipeline.gains import PHONE, TABLE_II_WITH_EKF, Gains
from pipeline.signals import VirtualView

DT = 1e-6
GAINS = TABLE_II_WITH_EKF


def random_view(rng: np.random.Generator) -> VirtualView:
    return VirtualView(
        R_fv=exp(rng.normal(size=3)),
        omega_vf_in_v=rng.normal(size=3),
        p_bv_in_v=rng.normal(size=3),
        R_vb=exp(rng.normal(size=3)),
        v_bv_in_v=rng.normal(size=3),
        omega_bf_in_b=rng.normal(size=3),
    )


def after(view: VirtualView, dt: float) -> VirtualView:
    """The same motion `dt` later: v turns, b turns and moves."""
    R_vb = exp(-view.omega_vf_in_v * dt) @ view.R_vb @ exp(view.omega_bf_in_b * dt)
    p_bv_in_v = view.p_bv_in_v + dt * view.v_bv_in_v
    return VirtualView(
        view.R_fv, view.omega_vf_in_v, p_bv_in_v, R_vb, view.v_bv_in_v, view.omega_bf_in_b
    )


@pytest.mark.parametrize("seed", range(20))
def test_rates_are_the_derivatives_of_the_errors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    view = random_view(rng)
    # small attitude error: there the rotation vector's derivative is the rate, Eq. (18)
    reference = Reference(rng.normal(size=3), view.R_vb @ exp(1e-4 * rng.normal(size=3)))
    error, later = pose_error(view, reference), pose_error(after(view, DT), reference)
    np.testing.assert_allclose(
        (later.e_p_in_v - error.e_p_in_v) / DT, error.e_p_rate_in_v, atol=1e-6
    )
    np.testing.assert_allclose(
        (later.e_eta_in_b - error.e_eta_in_b) / DT, error.e_eta_rate_in_b, atol=1e-3
    )


def test_at_the_reference_and_at_rest_nothing_is_asked() -> None:
    view = random_view(np.random.default_rng(0))
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    wrench = Pid(GAINS).wrench(pose_error(still, Reference.here(still)), still)
    np.testing.assert_allclose(wrench, np.zeros(6), atol=1e-9)


def test_gains_act_along_the_axes_of_the_body() -> None:
    rng = np.random.default_rng(1)
    view = random_view(rng)
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    along_body_z = still.R_vb @ np.array([0.0, 0.0, 0.1])
    error = pose_error(still, Reference(still.p_bv_in_v + along_body_z, still.R_vb))
    np.testing.assert_allclose(
        Pid(GAINS).wrench(error, still)[:3], [0.0, 0.0, 0.1 * GAINS.Kp[2]], atol=1e-9
    )


def test_a_learnt_force_stays_where_it_is_in_f_when_everything_turns() -> None:
    rng = np.random.default_rng(2)
    pid, view = Pid(GAINS), random_view(rng)
    reference = Reference(view.p_bv_in_v + 0.05, view.R_vb)
    pid.integrate(pose_error(view, reference), view, np.zeros(6), 0.5)
    turned = VirtualView(
        exp(rng.normal(size=3)),
        np.zeros(3),
        view.p_bv_in_v,
        exp(rng.normal(size=3)),
        np.zeros(3),
        np.zeros(3),
    )
    force_in_f = [
        v.R_fb @ pid.wrench(pose_error(v, Reference.here(v)), v)[:3]
        for v in (VirtualView(view.R_fv, *[np.zeros(3)] * 2, view.R_vb, *[np.zeros(3)] * 2), turned)  # type: ignore[call-arg]
    ]
    np.testing.assert_allclose(force_in_f[0], force_in_f[1], atol=1e-9)
    assert np.linalg.norm(force_in_f[0]) > 1.0


def test_taking_over_a_held_force_goes_on_with_that_force() -> None:
    pid, view, force_in_f = Pid(GAINS), random_view(np.random.default_rng(4)), np.ones(3)
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    pid.take_over(force_in_f)
    wrench = pid.wrench(pose_error(still, Reference.here(still)), still)
    np.testing.assert_allclose(still.R_fb @ wrench[:3], force_in_f, atol=1e-9)


def test_what_the_thrusters_could_not_give_is_not_integrated_for_ever() -> None:
    view = random_view(np.random.default_rng(3))
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    error = pose_error(still, Reference(still.p_bv_in_v + 0.5, still.R_vb))
    limit, pid = 5.0, Pid(GAINS)
    for _ in range(5000):
        wrench = pid.wrench(error, still)
        pid.integrate(error, still, wrench - np.clip(wrench, -limit, limit), 0.005)
    more = GAINS.Ki[:3] * (still.R_vb.T @ error.e_p_in_v) * BACK_S
    assert (np.abs(wrench[:3]) <= limit + np.abs(more) + 1e-6).all()


def test_torque_the_thrusters_could_not_give_is_not_integrated_either() -> None:
    view = random_view(np.random.default_rng(6))
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    turned = still.R_vb @ exp(np.array([0.3, -0.2, 0.25]))
    error = pose_error(still, Reference(still.p_bv_in_v, turned))
    limit, pid = 0.2, Pid(GAINS)
    for _ in range(5000):
        wrench = pid.wrench(error, still)
        pid.integrate(error, still, wrench - np.clip(wrench, -limit, limit), 0.005)
    more = GAINS.Ki[3:] * error.e_eta_in_b * BACK_S
    assert (np.abs(wrench[3:]) <= limit + np.abs(more) + 1e-6).all()
    assert np.abs(wrench[3:]).min() >= limit
    np.testing.assert_allclose(wrench[:3], 0.0, atol=1e-9)


def place(x: float, v: float) -> VirtualView:
    """On the x axis, everything level."""
    along = np.array([1.0, 0.0, 0.0])
    return VirtualView(np.eye(3), np.zeros(3), x * along, np.eye(3), v * along, np.zeros(3))


def overshoot(gains: Gains, limit: float, mass: float, axes: np.ndarray = ALL_AXES) -> float:
    """Of a step of 0.6 m, as a share of it: thrusters of 25 ms lag, some air."""
    pid, reference = Pid(gains, axes), Reference(np.array([0.6, 0.0, 0.0]), np.eye(3))
    x = v = force = farthest = 0.0
    for _ in range(2000):
        view = place(x, v)
        error = pose_error(view, reference)
        wrench = pid.wrench(error, view)
        achieved = np.clip(wrench, -limit, limit)
        pid.integrate(error, view, wrench - achieved, 0.005)
        force += (achieved[0] - force) * 0.2
        v += 0.005 * (force - 1.5 * v) / mass
        x += 0.005 * v
        farthest = max(farthest, x)
    return farthest / 0.6 - 1.0


@pytest.mark.parametrize("gains", [TABLE_II_WITH_EKF, PHONE])
@pytest.mark.parametrize("mass", [2.5, 3.5])
def test_a_step_far_beyond_the_thrusters_overshoots_less_than_one_within(
    gains: Gains, mass: float
) -> None:
    assert overshoot(gains, 7.0, mass) <= 0.06
    assert overshoot(gains, np.inf, mass) > 0.15


def test_an_axis_let_alone_is_asked_for_nothing_and_learns_nothing() -> None:
    rng, axes = np.random.default_rng(6), np.array([True, True, False, False, False, True])
    pid, view = Pid(GAINS, axes), random_view(rng)
    error = pose_error(view, Reference(rng.normal(size=3), exp(rng.normal(size=3))))
    for _ in range(100):
        pid.integrate(error, view, rng.normal(size=6), 0.005)
    wrench = pid.wrench(error, view)
    assert (wrench[~axes] == 0.0).all()
    assert (wrench[axes] != 0.0).all()


def test_the_error_of_an_axis_let_alone_does_not_count() -> None:
    rng, axes = np.random.default_rng(7), np.array([True, False, True, False, True, False])
    view = random_view(rng)
    reference = Reference(rng.normal(size=3), exp(rng.normal(size=3)))
    whole, masked = pose_error(view, reference), pose_error(view, reference, axes)
    for name in ("e_p_in_v", "e_p_rate_in_v"):
        in_b = [view.R_vb.T @ getattr(error, name) for error in (whole, masked)]
        np.testing.assert_allclose(in_b[1], np.where(axes[:3], in_b[0], 0.0), atol=1e-12)
    for name in ("e_eta_in_b", "e_eta_rate_in_b"):
        np.testing.assert_allclose(
            getattr(masked, name), np.where(axes[3:], getattr(whole, name), 0.0)
        )


def test_a_mask_changes_nothing_on_the_other_axes() -> None:
    axes = np.array([True, False, False, False, False, False])
    assert overshoot(PHONE, 7.0, 3.5, axes) == pytest.approx(overshoot(PHONE, 7.0, 3.5))


def test_gains_of_zero_on_an_axis_let_alone_are_no_division_by_zero() -> None:
    gains = Gains(*(np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0]) for _ in range(3)))
    view = random_view(np.random.default_rng(8))
    pid = Pid(gains)
    pid.integrate(pose_error(view, Reference.here(view)), view, np.ones(6), 0.005)
    assert np.isfinite(pid.wrench(pose_error(view, Reference.here(view)), view)).all()


def test_a_weight_is_carried_upwards_in_f_from_the_first_moment() -> None:
    view = random_view(np.random.default_rng(9))
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    pid = Pid(GAINS, weight=11.8)
    R_fb, nothing = still.R_fb, pose_error(still, Reference.here(still))
    np.testing.assert_allclose(R_fb @ pid.wrench(nothing, still)[:3], [0, 0, 11.8], atol=1e-9)
    pid.take_over(np.array([1.0, 2.0, 10.0]))
    np.testing.assert_allclose(R_fb @ pid.wrench(nothing, still)[:3], [1, 2, 10], atol=1e-9)
    pid.reset()
    np.testing.assert_allclose(pid.constant_force_in_f, [0.0, 0.0, 11.8])


def test_a_turning_reference_asks_for_the_same_turn_of_the_body() -> None:
    omega = np.array([0.1, -0.2, 0.3])
    R_vb = exp(np.array([0.3, 0.2, 0.1]))
    p = np.array([2.5, 0.0, 0.0])
    view = VirtualView(np.eye(3), omega, p, R_vb, -cross(omega, p), R_vb.T @ omega)
    error = pose_error(view, Reference.here(view))
    np.testing.assert_allclose(error.e_eta_rate_in_b, np.zeros(3), atol=1e-12)
