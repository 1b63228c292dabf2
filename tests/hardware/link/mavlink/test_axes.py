"""Axes of MAVLink by vectors that anybody can check by hand."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from hardware.link.mavlink.axes import (
    R_na_from_rpy,
    R_na_from_wxyz,
    in_b,
    pose_in_n,
    told_in_h,
)
from pipeline.estimation.standing_camera import StandingPose
from pipeline.frames import R_from_rpy, rotation_about_y, rotation_about_z

LEVEL = np.eye(3)
S, C = sin(radians(30.0)), cos(radians(30.0))


def in_h(twist, R_na):
    v, yaw_rate = told_in_h(np.array(twist, dtype=float), R_na)
    return [*v, yaw_rate]


@pytest.mark.parametrize(
    ("twist_in_b", "told"),
    [
        ([1, 0, 0, 0, 0, 0], [1, 0, 0, 0]),  # forward is forward
        ([0, 1, 0, 0, 0, 0], [0, -1, 0, 0]),  # left is less than right
        ([0, 0, 1, 0, 0, 0], [0, 0, -1, 0]),  # up is less than down
        ([0, 0, 0, 0, 0, 1], [0, 0, 0, -1]),  # anticlockwise from above
    ],
)
@pytest.mark.parametrize("yaw", [0.0, 1.0, -pi])
def test_level_it_is_told_forward_right_down_whatever_its_heading(twist_in_b, told, yaw):
    assert in_h(twist_in_b, R_na_from_rpy(0.0, 0.0, yaw)) == pytest.approx(told, abs=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_with_its_nose_down_by_30_degrees_its_own_forward_goes_down_by_half(yaw):
    R_na = R_na_from_rpy(0.0, radians(-30.0), yaw)
    assert in_h([1, 0, 0, 0, 0, 0], R_na) == pytest.approx([C, 0, S, 0], abs=1e-12)
    assert in_h([0, 0, 1, 0, 0, 0], R_na) == pytest.approx([S, 0, -C, 0], abs=1e-12)
    # cos 30° of a turn about its own z is about the vertical
    assert in_h([0, 0, 0, 0, 0, 1], R_na) == pytest.approx([0, 0, 0, -C], abs=1e-12)


def test_rolled_to_the_right_by_30_degrees_its_own_right_goes_down():
    R_na = R_na_from_rpy(radians(30.0), 0.0, 0.0)
    assert in_h([0, -1, 0, 0, 0, 0], R_na) == pytest.approx([0, C, S, 0], abs=1e-12)


def test_a_turn_about_the_vertical_is_told_whole_however_it_tilts():
    for rpy in ((0.3, -0.4, 1.0), (-0.6, 0.2, 3.0)):
        R_na = R_na_from_rpy(*rpy)
        omega_in_b = R_na.T @ np.array([0.0, 0.0, 0.5]) * [1.0, -1.0, -1.0]
        assert in_h([0, 0, 0, *omega_in_b], R_na) == pytest.approx([0, 0, 0, 0.5], abs=1e-12)


def test_no_speed_is_lost_by_a_change_of_axes():
    rng = np.random.default_rng(4)
    for _ in range(50):
        v, R_na = rng.normal(size=3), R_from_rpy(rng.normal(size=3))
        told, _ = told_in_h(np.array([*v, 0.0, 0.0, 0.0]), R_na)
        assert np.linalg.norm(told) == pytest.approx(np.linalg.norm(v))


def test_angles_and_quaternion_say_the_same_attitude():
    half = radians(45.0)
    R_na = R_na_from_wxyz((cos(half), 0.0, 0.0, sin(half)))  # nose to the east
    assert R_na == pytest.approx(R_na_from_rpy(0.0, 0.0, radians(90.0)))
    assert R_na @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize("wxyz", [(0, 0, 0, 0), (2, 0, 0, 0), (np.nan, 0, 0, 1), (np.inf, 0, 0, 0)])
def test_what_is_no_quaternion_is_no_attitude(wxyz):
    assert R_na_from_wxyz(wxyz) is None


def test_what_its_body_says_is_ours_after_half_a_turn_about_forward():
    assert in_b(np.array([1.0, 2.0, 3.0])) == (1.0, -2.0, -3.0)
    at_rest_down = np.array([0.0, 0.0, -9.8])
    assert in_b(at_rest_down)[2] == 9.8


def seen(R_sb=LEVEL, covariance=LEVEL):
    return StandingPose(7.0, np.array([2.0, 0.5, -0.25]), R_sb, covariance, 1)


def test_where_it_is_seen_is_told_forward_right_down():
    place, wxyz, _ = pose_in_n(seen(covariance=np.eye(6)))
    assert place == (2.0, -0.5, 0.25)
    assert wxyz == pytest.approx((1.0, 0.0, 0.0, 0.0))


def test_a_turn_to_its_left_is_one_against_the_clock_and_its_nose_up_is_up():
    left = pose_in_n(seen(rotation_about_z(radians(90.0)), np.eye(6)))[1]
    assert left == pytest.approx((sin(pi / 4), 0.0, 0.0, -sin(pi / 4)))
    up = pose_in_n(seen(rotation_about_y(radians(-60.0)), np.eye(6)))[1]  # about left, by the hand
    assert up == pytest.approx((C, 0.0, S, 0.0))
    assert R_na_from_wxyz(up) == pytest.approx(R_na_from_rpy(0.0, radians(60.0), 0.0))


def test_a_covariance_goes_row_by_row_and_keeps_its_variances():
    covariance = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    covariance[0, 1] = covariance[1, 0] = 0.5
    rows = pose_in_n(seen(covariance=covariance))[2]
    assert [rows[k] for k in (0, 6, 11, 15, 18, 20)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert rows[1] == -0.5  # forward with right
