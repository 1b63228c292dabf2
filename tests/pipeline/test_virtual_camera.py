"""Virtual camera: cut-off, smoothness across the wrap, origin shared with the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config import VirtualCameraConfig
from pipeline.frames import cross, exp, log, rotation_about_y, rotation_about_z
from pipeline.signals import RelativeState
from pipeline.virtual_camera import VirtualCamera, cutoff_hz

H = 0.005
PAPER = VirtualCameraConfig(tau_1=3.18, tau_2=0.16)


def relative(p: np.ndarray, R_cb: np.ndarray) -> RelativeState:
    return RelativeState(
        t=0.0,
        p_bc_in_c=p,
        R_cb=R_cb,
        u_bf_in_c=np.array([0.1, -0.2, 0.05]),
        omega_bf_in_b=np.zeros(3),
        omega_cf_in_c=np.zeros(3),
        R_ic=np.eye(3),
        sigma_p=0.0,
        sigma_theta=0.0,
        age=0.0,
    )


def test_the_papers_time_constants_mean_a_twentieth_of_a_hertz() -> None:
    assert cutoff_hz(PAPER) == pytest.approx(0.05, rel=0.02)
    assert cutoff_hz(VirtualCameraConfig()) == pytest.approx(0.28, rel=0.02)


def test_a_sine_at_the_cutoff_is_passed_at_minus_three_decibels() -> None:
    camera, f = VirtualCamera(VirtualCameraConfig()), cutoff_hz(VirtualCameraConfig())
    yaw = []
    for k in range(int(30.0 / f / H / 2)):
        R_fc = rotation_about_z(0.05 * np.sin(2 * np.pi * f * k * H))
        R_fv, _ = camera.step(R_fc, np.zeros(3), H)
        yaw.append(log(R_fv)[2])
    amplitude = np.abs(yaw[len(yaw) // 2 :]).max() / 0.05
    assert amplitude == pytest.approx(np.sqrt(0.5), rel=0.02)


@pytest.mark.parametrize("pitch", [0.0, np.pi / 2])
def test_turning_through_half_a_turn_or_looking_straight_up_never_jumps(pitch: float) -> None:
    camera = VirtualCamera(VirtualCameraConfig())
    last, largest = None, 0.0
    for k in range(2000):
        R_fc = rotation_about_z(np.pi - 0.5 + 0.0005 * k) @ rotation_about_y(pitch)
        R_fv, _ = camera.step(R_fc, np.zeros(3), H)
        if last is not None:
            largest = max(largest, float(np.linalg.norm(log(last.T @ R_fv))))
        last = R_fv
    assert largest <= 0.0005 * 1.01  # never faster than the camera itself


def test_rate_is_the_derivative_of_the_attitude() -> None:
    camera, rng = VirtualCamera(PAPER), np.random.default_rng(0)
    R_fc, before = np.eye(3), None
    for _ in range(200):
        R_fc = R_fc @ exp(0.02 * rng.normal(size=3))
        R_fv, omega_vf_in_v = camera.step(R_fc, np.zeros(3), H)
        if before is not None:
            np.testing.assert_allclose(before @ exp(omega_vf_in_v * H), R_fv, atol=1e-9)
        before = R_fv


def test_switched_off_it_is_the_camera() -> None:
    camera = VirtualCamera(replace(PAPER, tau_1=0.0))
    R_fc, omega = exp(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0])
    state = replace(relative(np.array([2.5, 0.1, 0.2]), np.eye(3)), omega_cf_in_c=omega)
    view = camera.view(state, R_fc, H)
    np.testing.assert_allclose(view.p_bv_in_v, state.p_bc_in_c)
    np.testing.assert_allclose(
        view.v_bv_in_v, state.u_bf_in_c - cross(omega, state.p_bc_in_c), atol=1e-12
    )


def test_where_the_robot_is_in_f_does_not_depend_on_the_filter() -> None:
    camera, rng = VirtualCamera(VirtualCameraConfig()), np.random.default_rng(3)
    for _ in range(50):
        R_fc, R_cb = exp(rng.normal(size=3)), exp(rng.normal(size=3))
        state = relative(rng.normal(size=3), R_cb)
        view = camera.view(state, R_fc, H)
        np.testing.assert_allclose(view.R_fv @ view.p_bv_in_v, R_fc @ state.p_bc_in_c, atol=1e-12)
        np.testing.assert_allclose(view.R_fv @ view.R_vb, R_fc @ R_cb, atol=1e-12)
