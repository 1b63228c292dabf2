"""Virtual camera: cut-off, smoothness across the wrap, line of sight, what v sees."""

from __future__ import annotations

from dataclasses import replace
from math import inf, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.config import VirtualCameraConfig
from pipeline.control.cutoff import cutoff_hz, time_constants
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.frames import cross, exp, log, rotation_about_x, rotation_about_y, rotation_about_z
from tests.pipeline.turning import (
    FREE,
    HALF_FIELD,
    Follower,
    H,
    configs,
    follow,
    minimum_jerk,
    off_axis,
    relative,
    rotations,
    sights,
    turn,
)

PAPER = VirtualCameraConfig(tau_1=3.18, tau_2=0.16)


def time_to_nine_tenths(follower: Follower, angle: float) -> float:
    made = np.array([np.linalg.norm(log(R)) for R in follower.R_fv])
    return float(np.argmax(made >= 0.9 * angle)) * H


def test_the_papers_time_constants_mean_a_twentieth_of_a_hertz() -> None:
    assert cutoff_hz(PAPER) == pytest.approx(0.05, rel=0.02)
    assert cutoff_hz(VirtualCameraConfig()) == pytest.approx(0.28, rel=0.02)
    assert cutoff_hz(replace(PAPER, mode="off")) == inf


@given(hz=st.floats(0.02, 5.0))
def test_time_constants_give_the_cutoff_they_are_made_for(hz: float) -> None:
    assert cutoff_hz(VirtualCameraConfig(*time_constants(hz))) == pytest.approx(hz, rel=1e-9)


def test_time_constants_of_the_comfortable_cutoff_are_the_defaults() -> None:
    config = VirtualCameraConfig()
    assert time_constants(0.28) == pytest.approx((config.tau_1, config.tau_2), rel=1e-3)
    assert time_constants(0.05) == pytest.approx((3.18, 0.16), rel=2e-3)


@given(first=rotations, later=rotations, turn_of_f=rotations)
def test_axes_of_f_put_right_are_no_motion(first, later, turn_of_f) -> None:
    seen, robot = [], relative(np.array([0.0, 0.0, 2.5]), np.eye(3))
    for R in (np.eye(3), turn_of_f):
        camera = VirtualCamera(PAPER)
        camera.view(robot, first, H)
        camera.turn(R)
        seen.append(camera.view(robot, R @ later, H))
    before, turned = seen
    np.testing.assert_allclose(turned.R_fv, turn_of_f @ before.R_fv, atol=1e-9)
    for name in ("omega_vf_in_v", "p_bv_in_v", "v_bv_in_v", "R_vb"):
        np.testing.assert_allclose(getattr(turned, name), getattr(before, name), atol=1e-6)


def test_a_sine_at_the_cutoff_is_passed_at_minus_three_decibels() -> None:
    config, f = VirtualCameraConfig(), cutoff_hz(VirtualCameraConfig())
    seconds = np.arange(0.0, 4.0 / f, H)
    waves = (rotation_about_z(0.05 * np.sin(2 * np.pi * f * t)) for t in seconds)
    yaw = [log(R)[2] for R in follow(config, waves).R_fv]
    amplitude = np.abs(yaw[len(yaw) // 2 :]).max() / 0.05
    assert amplitude == pytest.approx(np.sqrt(0.5), rel=0.02)


@pytest.mark.parametrize("mode", ["full", "selective"])
@pytest.mark.parametrize("pitch", [0.0, np.pi / 2])
def test_turning_through_half_a_turn_or_looking_straight_up_never_jumps(
    pitch: float, mode: str
) -> None:
    def speed(yaw_start: float, pitch: float) -> float:
        sweep = (
            rotation_about_z(yaw_start + 0.002 * k) @ rotation_about_y(pitch) for k in range(1000)
        )
        return float(follow(replace(FREE, mode=mode), sweep).speed.max())

    near, far = speed(np.pi - 0.5, pitch), speed(-2.0, 0.0)
    assert near <= 1.3 * far


def test_rate_is_the_derivative_of_the_attitude() -> None:
    rng, R_fc, attitudes = np.random.default_rng(0), np.eye(3), []
    for _ in range(200):
        R_fc = R_fc @ exp(0.02 * rng.normal(size=3))
        attitudes.append(R_fc)
    for config in (PAPER, replace(PAPER, mode="selective"), replace(PAPER, mode="off")):
        made = follow(config, attitudes)
        for before, after, omega in zip(made.R_fv, made.R_fv[1:], made.omega[1:], strict=False):
            np.testing.assert_allclose(before @ exp(omega * H), after, atol=1e-9)


def test_switched_off_it_is_the_camera() -> None:
    camera, omega = VirtualCamera(replace(FREE, mode="off")), np.array([1.0, 2.0, 3.0])
    state, R_fc = relative(np.array([2.5, 0.1, 0.2]), np.eye(3)), exp(np.array([0.1, 0.2, 0.3]))
    camera.view(state, R_fc, H)
    view = camera.view(state, R_fc @ exp(omega * H), H)
    np.testing.assert_allclose(view.p_bv_in_v, state.p_bc_in_c, atol=1e-12)
    np.testing.assert_allclose(
        view.v_bv_in_v, state.u_bf_in_c - cross(omega, state.p_bc_in_c), atol=1e-9
    )


@settings(max_examples=30)
@given(config=configs, p=sights, R_fc=rotations, R_cb=rotations)
def test_where_the_robot_is_in_f_does_not_depend_on_the_filter(config, p, R_fc, R_cb) -> None:
    camera = VirtualCamera(config)
    for k in range(3):
        R = R_fc @ rotation_about_x(0.1 * k)
        view = camera.view(relative(p, R_cb), R, H, p, HALF_FIELD)
        np.testing.assert_allclose(view.R_fv @ view.p_bv_in_v, R @ p, atol=1e-12)
        np.testing.assert_allclose(view.R_fb, R @ R_cb, atol=1e-12)
        v_in_f = view.R_fv @ (view.v_bv_in_v + cross(view.omega_vf_in_v, view.p_bv_in_v))
        np.testing.assert_allclose(v_in_f, R @ relative(p, R_cb).u_bf_in_c, atol=1e-9)


@settings(max_examples=30)
@given(config=configs, p=sights, R_fc=rotations)
def test_a_camera_held_still_sees_a_still_view(config, p, R_fc) -> None:
    made = follow(config, [R_fc] * 5, p, HALF_FIELD)
    assert max(made.lag) < 1e-9
    assert max(np.linalg.norm(omega) for omega in made.omega) < 1e-6


@settings(max_examples=20)
@given(p=sights, G=rotations, seed=st.integers(0, 99))
def test_turning_the_whole_world_changes_nothing(p, G, seed) -> None:
    steps = 0.03 * np.random.default_rng(seed).normal(size=(20, 3))
    attitudes = [np.eye(3)]
    for step in steps:
        attitudes.append(attitudes[-1] @ exp(step))
    here, there = follow(FREE, attitudes, p), follow(FREE, [G @ R for R in attitudes], p)
    np.testing.assert_allclose([G @ R for R in here.R_fv], there.R_fv, atol=1e-10)
    np.testing.assert_allclose(here.omega, there.omega, atol=1e-8)


@settings(max_examples=15)
@given(p=sights, amount=st.floats(0.05, 1.0))
def test_selective_lets_a_roll_about_the_line_of_sight_pass_at_once(p, amount) -> None:
    n = p / np.linalg.norm(p)
    rolls = [exp(amount * minimum_jerk(k * H / 0.3) * n) for k in range(80)]
    made = follow(replace(FREE, mode="selective"), rolls, p)
    assert max(made.lag) < 1e-9
    assert made.speed.max() < 1e-9  # and it doesn't move the reference


@pytest.mark.parametrize("side", [0.0, 20.0])
def test_selective_attenuates_tremor_across_the_line_of_sight_as_full_does(side: float) -> None:
    p, f = off_axis(side), 10.0
    sideways = np.array([0.0, 0.0, 1.0])
    shaking = [exp(0.0005 * np.sin(2 * np.pi * f * k * H) * sideways) for k in range(400)]
    raw, full, selective = (
        follow(replace(FREE, mode=mode), shaking, p).speed[200:].max()
        for mode in ("off", "full", "selective")
    )
    assert full < 0.01 * raw
    assert selective == pytest.approx(full, rel=1e-6)


def test_a_roll_about_the_optical_axis_moves_a_robot_beside_it_and_is_filtered_that_far() -> None:
    config = replace(FREE, mode="selective")
    made = follow(config, turn(radians(1.0), 0.05, 0.0, rotation_about_x), off_axis(20.0))
    raw = follow(
        replace(config, mode="off"), turn(radians(1.0), 0.05, 0.0, rotation_about_x), off_axis(20.0)
    )
    assert made.speed.max() < 0.1 * raw.speed.max()


@pytest.mark.parametrize(("mode", "seconds"), [("off", 0.46), ("full", 1.71), ("selective", 0.46)])
def test_a_roll_arrives_as_soon_as_the_mode_says(mode: str, seconds: float) -> None:
    angle = radians(20.0)
    made = follow(replace(FREE, mode=mode), turn(angle, 0.6, 3.0, rotation_about_x))
    assert time_to_nine_tenths(made, angle) == pytest.approx(seconds, abs=0.01)


def test_roll_has_its_own_short_time_constant_if_wanted() -> None:
    config = replace(FREE, mode="selective", tau_parallel=0.1)
    made = follow(config, [np.eye(3), *[rotation_about_x(0.01)] * 20])
    assert log(made.R_fv[-1])[0] == pytest.approx(0.01 * (1.0 - np.exp(-1.0)), rel=1e-3)


def test_a_turn_of_three_degrees_is_smoothed_as_the_design_says() -> None:
    made = follow(VirtualCameraConfig(), turn(radians(3.0), 0.3, 3.0))
    assert made.speed.max() == pytest.approx(0.145, abs=0.002)
    assert made.acceleration.max() == pytest.approx(0.71, abs=0.02)
    assert time_to_nine_tenths(made, radians(3.0)) == pytest.approx(1.55, abs=0.02)


def test_adaptive_follows_a_large_turn_sooner_and_tremor_no_more() -> None:
    adaptive, angle = replace(FREE, adaptive_beta=2.0), radians(20.0)
    sooner = follow(adaptive, turn(angle, 0.6, 3.0))
    assert time_to_nine_tenths(sooner, angle) < 0.65 * 1.71
    shaking = [rotation_about_z(0.0005 * np.sin(2 * np.pi * 10.0 * k * H)) for k in range(400)]
    calm, shaken = (follow(config, shaking).speed[200:].max() for config in (FREE, adaptive))
    assert shaken < 1.05 * calm
