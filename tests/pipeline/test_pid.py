"""Pose error and PID: rates are derivatives, the integral lives in f, wind-up is taken back."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.config import TABLE_II_WITH_EKF
from pipeline.frames import cross, exp
from pipeline.pid import Pid, Reference, pose_error
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
        v.R_fv @ v.R_vb @ pid.wrench(pose_error(v, Reference.here(v)), v)[:3]
        for v in (VirtualView(view.R_fv, *[np.zeros(3)] * 2, view.R_vb, *[np.zeros(3)] * 2), turned)
    ]
    np.testing.assert_allclose(force_in_f[0], force_in_f[1], atol=1e-9)
    assert np.linalg.norm(force_in_f[0]) > 1.0


def test_taking_over_a_held_force_goes_on_with_that_force() -> None:
    pid, view, force_in_f = Pid(GAINS), random_view(np.random.default_rng(4)), np.ones(3)
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    pid.take_over(force_in_f)
    wrench = pid.wrench(pose_error(still, Reference.here(still)), still)
    np.testing.assert_allclose(still.R_fv @ still.R_vb @ wrench[:3], force_in_f, atol=1e-9)


def test_what_the_thrusters_could_not_give_is_not_integrated_for_ever() -> None:
    view = random_view(np.random.default_rng(3))
    still = VirtualView(view.R_fv, np.zeros(3), view.p_bv_in_v, view.R_vb, np.zeros(3), np.zeros(3))
    error = pose_error(still, Reference(still.p_bv_in_v + 0.5, still.R_vb))
    limit, pid = 5.0, Pid(GAINS)
    for _ in range(20_000):
        wrench = pid.wrench(error, still)
        pid.integrate(error, still, wrench - np.clip(wrench, -limit, limit), 0.005)
    integral = wrench[:3] - GAINS.Kp[:3] * (still.R_vb.T @ error.e_p_in_v)
    bound = limit + 2 * np.abs(GAINS.Kp[:3] * (still.R_vb.T @ error.e_p_in_v))
    assert (np.abs(integral) <= bound).all()


def test_a_turning_reference_asks_for_the_same_turn_of_the_body() -> None:
    omega = np.array([0.1, -0.2, 0.3])
    R_vb = exp(np.array([0.3, 0.2, 0.1]))
    p = np.array([2.5, 0.0, 0.0])
    view = VirtualView(np.eye(3), omega, p, R_vb, -cross(omega, p), R_vb.T @ omega)
    error = pose_error(view, Reference.here(view))
    np.testing.assert_allclose(error.e_eta_rate_in_b, np.zeros(3), atol=1e-12)
