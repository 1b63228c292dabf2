"""Virtual camera: speed limit, guard of the picture, knobs turned in flight, reset."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.config import VirtualCameraConfig
from pipeline.control import virtual_camera_kernels as kernels
from pipeline.control.cutoff import time_constants
from pipeline.control.virtual_camera import VirtualCamera
from pipeline.frames import exp, rotation_about_z
from tests.pipeline.turning import (
    AHEAD,
    DISTANCE_M,
    FREE,
    HALF_FIELD,
    H,
    configs,
    follow,
    off_axis,
    relative,
    rotations,
    sights,
    turn,
)


@settings(max_examples=30)
@given(
    p=sights,
    limit=st.floats(0.05, 2.0),
    mode=st.sampled_from(["full", "selective", "off"]),
    axis=rotations,
)
def test_no_turn_throws_the_reference_faster_than_the_limit(p, limit, mode, axis) -> None:
    config = VirtualCameraConfig(mode=mode, max_speed_m_s=limit, adaptive_beta=5.0)
    attitudes = [exp(0.06 * k * axis[0]) for k in range(25)]
    assert follow(config, attitudes, p, HALF_FIELD).speed.max() <= limit * (1.0 + 1e-9)


def test_after_the_limit_the_reference_arrives_without_a_second_throw() -> None:
    slow = replace(FREE, max_speed_m_s=0.3)
    follower = follow(slow, turn(radians(30.0), 0.3, 0.5))
    behind = follower.lag[-1]
    follower.camera.tune(FREE)
    for _ in range(1200):
        follower.step(rotation_about_z(radians(30.0)))
    assert follower.speed[160:].max() < DISTANCE_M * behind / FREE.tau_1
    assert follower.lag[-1] < 0.01


def test_the_limit_leaves_the_moving_hand_alone() -> None:
    t = np.arange(0.0, 10.0, H)
    yaw = radians(3.0) * np.sin(2 * np.pi * 0.3 * t)  # three times its RMS
    with_limit = follow(replace(FREE, max_speed_m_s=1.0), map(rotation_about_z, yaw))
    without = follow(FREE, map(rotation_about_z, yaw))
    np.testing.assert_array_equal(with_limit.R_fv, without.R_fv)


@pytest.mark.parametrize("start", [0.0, 5.0, 10.0, 15.0])
@pytest.mark.parametrize("cutoff", [0.05, 0.28])
def test_guarded_the_robot_stays_in_the_picture_in_a_turn_of_twenty_degrees(
    start: float, cutoff: float
) -> None:
    config = VirtualCameraConfig(*time_constants(cutoff))
    made = follow(config, turn(radians(-20.0), 0.6, 3.0), off_axis(start), HALF_FIELD)
    assert made.out().max() < 0.95
    assert made.guarding[-1] == 0.0  # and then it filters as before


def test_unguarded_it_would_leave() -> None:
    turns = list(turn(radians(-40.0), 1.2, 3.0))
    guarded = replace(FREE, guard=True)
    for config, stays in ((FREE, False), (guarded, True)):
        assert (follow(config, turns, off_axis(15.0), HALF_FIELD).out().max() < 1.0) == stays


@pytest.mark.parametrize("start", [0.0, 15.0, 25.0, 31.0])
def test_a_robot_that_began_near_the_border_is_not_guarded_without_a_lag(start: float) -> None:
    shaking = [rotation_about_z(0.0005 * np.sin(2 * np.pi * 10.0 * k * H)) for k in range(200)]
    made = follow(VirtualCameraConfig(), shaking, off_axis(start), HALF_FIELD)
    assert max(made.guarding) < 0.02
    plain = follow(FREE, shaking, off_axis(start))
    assert made.speed[100:].max() < 1.2 * plain.speed[100:].max()


def test_without_a_reference_or_a_field_nothing_is_guarded() -> None:
    camera = VirtualCamera(VirtualCameraConfig())
    outside = relative(np.array([1.0, 5.0, 0.0]), np.eye(3))
    for p_ref, field in ((None, HALF_FIELD), (AHEAD, None)):
        camera.view(outside, np.eye(3), H, p_ref, field)
        assert camera.guarding == 0.0
    camera.view(outside, np.eye(3), H, AHEAD, HALF_FIELD)
    assert camera.guarding > 0.0


@settings(max_examples=40)
@given(before=configs, after=configs, angle=st.floats(0.0, 0.4))
def test_a_knob_turned_in_flight_never_jumps(before, after, angle) -> None:
    follower = follow(before, turn(angle, 0.195, 0.005), AHEAD, HALF_FIELD)
    follower.camera.tune(after)
    lag = follower.lag[-1]
    for _ in range(60):
        follower.step(rotation_about_z(angle))
    assert np.diff(follower.lag[40:]).max() <= 1e-12  # only ever towards the camera
    omega = np.linalg.norm(follower.omega, axis=1)[40:]
    # no more than before, or than the guard may hurry what is left to go
    assert omega.max() <= np.linalg.norm(follower.omega[39]) + 30.0 * lag + 1e-9


def test_the_guard_and_a_higher_limit_come_by_and_by_and_a_lower_limit_at_once() -> None:
    """Per second: all of the guard in a sixth of one, a limit by e⁴."""
    camera = VirtualCamera(replace(FREE, guard=True, max_speed_m_s=0.1))
    outside, inside = (relative(np.array([1.0, side, 0.0]), np.eye(3)) for side in (5.0, 0.0))
    said = []
    for robot in (outside, inside):
        for _ in range(100):
            camera.view(robot, np.eye(3), H, AHEAD, HALF_FIELD)
            said.append((camera.guarding, camera._state[kernels.LIMIT]))
    guard, limit = np.array(said).T
    assert guard[99] == 1.0
    assert guard[-1] == 0.0
    assert np.abs(np.diff(guard, prepend=0.0)).max() == pytest.approx(6.0 * H)
    assert np.ptp(limit) == 0.0
    for wanted, steps in ((1.0, 116), (0.1, 1)):
        camera.tune(replace(FREE, max_speed_m_s=wanted))
        before = camera._state[kernels.LIMIT]
        for k in range(1, steps + 1):
            camera.view(inside, np.eye(3), H, AHEAD, HALF_FIELD)
            risen = camera._state[kernels.LIMIT] - before
            assert risen == pytest.approx(min(4.0 * H * k, np.log(wanted) - before))
        assert camera._state[kernels.LIMIT] == pytest.approx(np.log(wanted))


def test_switching_off_takes_a_second_or_two_and_ends_at_the_camera() -> None:
    follower = follow(FREE, turn(radians(20.0), 0.6, 0.0))
    lag = follower.lag[-1]
    follower.camera.tune(replace(FREE, mode="off"))
    for _ in range(500):
        follower.step(rotation_about_z(radians(20.0)))
    assert np.linalg.norm(follower.omega, axis=1)[121:].max() < 3.0 * lag
    assert follower.lag[-1] < 1e-9


def test_reset_begins_at_the_camera_without_a_turn() -> None:
    follower = follow(VirtualCameraConfig(), turn(radians(20.0), 0.6, 0.0))
    assert follower.lag[-1] > 0.1
    follower.camera.reset()
    follower.step(rotation_about_z(radians(20.0)))
    assert follower.lag[-1] < 1e-12
    assert np.linalg.norm(follower.omega[-1]) < 1e-9


def test_any_layout_of_the_arrays_is_taken() -> None:
    camera, p = VirtualCamera(VirtualCameraConfig()), AHEAD.copy()
    p.setflags(write=False)
    R = np.asfortranarray(exp(np.array([0.1, 0.2, 0.3])))
    one = camera.view(relative(p, R.T), R.T, H, p[::1], (1, 1))
    camera.reset()
    other = camera.view(relative(AHEAD, R.T.copy()), R.T.copy(), H, AHEAD, (1.0, 1.0))
    np.testing.assert_array_equal(one.R_vb, other.R_vb)


def test_hours_of_small_turns_leave_a_rotation() -> None:
    camera, rng, R_fc = VirtualCamera(VirtualCameraConfig()), np.random.default_rng(2), np.eye(3)
    for _ in range(20_000):
        R_fc = exp(0.1 * rng.normal(size=3))
        R_fv = camera.follow(R_fc, AHEAD, H)
    np.testing.assert_allclose(R_fv @ R_fv.T, np.eye(3), atol=1e-12)
