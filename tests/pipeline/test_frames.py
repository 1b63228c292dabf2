"""Laws of rotations, checked near the identity, near π and near the gimbal's lock as well."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.frames import (
    GRAVITY,
    R_between,
    R_cd,
    R_cd_portrait,
    R_co,
    R_fc_level_from_specific_force,
    R_from_rpy,
    R_from_wxyz,
    S_in_a,
    S_in_b,
    cross,
    exp,
    log,
    rotation_about_x,
    rotation_about_y,
    rotation_about_z,
    rpy_from_R,
    skew,
    wrap,
    wxyz_from_R,
)

PI = np.pi
components = st.floats(-1.0, 1.0)
vectors = st.tuples(components, components, components).map(np.array)
unit_vectors = (
    vectors.filter(lambda v: v @ v > 1e-4).map(lambda v: v / np.sqrt(v @ v))
)  # fmt: skip
angles = st.one_of(
    st.floats(0.0, PI - 1e-6),
    st.floats(0.0, 1e-5),
    st.floats(1e-16, 1e-9),
    st.floats(1e-9, 1e-3).map(lambda gap: PI - gap),
)
rotation_vectors = st.builds(lambda n, angle: angle * n, unit_vectors, angles)
rotations = rotation_vectors.map(exp)
turns = st.floats(-PI + 1e-9, PI)
pitches = st.one_of(
    st.floats(-1.5, 1.5),
    st.builds(
        lambda side, gap: side * (PI / 2 - gap), st.sampled_from((-1, 1)), st.floats(1e-6, 0.1)
    ),
)
rpys = st.tuples(turns, pitches, turns).map(np.array)


@given(rotation_vectors)
def test_exp_is_a_rotation_and_log_takes_it_back(theta):
    R = exp(theta)
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    assert np.abs(log(R) - theta).max() < 1e-8 * max(1.0, 1e-6 / (PI - np.sqrt(theta @ theta)))


@given(unit_vectors)
def test_log_of_half_a_turn_is_pi_about_the_axis_or_against_it(n):
    theta = log(exp(PI * n))
    assert np.sqrt(theta @ theta) == pytest.approx(PI, abs=1e-7)
    assert np.abs(exp(theta) - exp(PI * n)).max() < 1e-7


@given(rotation_vectors, vectors)
def test_exp_keeps_its_axis_and_turns_by_its_angle(theta, v):
    R, angle = exp(theta), np.sqrt(theta @ theta)
    assert np.abs(R @ theta - theta).max() < 1e-14
    across = cross(theta, v)
    assert across @ R @ across == pytest.approx(np.cos(angle) * (across @ across), abs=1e-12)


@given(vectors, vectors)
def test_cross_and_skew_are_the_vector_product(a, b):
    assert np.array_equal(cross(a, b), np.cross(a, b))
    assert np.abs(skew(a) @ b - np.cross(a, b)).max() < 1e-15


@given(rotations)
def test_a_quaternion_has_unit_length_and_gives_its_rotation_back(R):
    wxyz = np.array(wxyz_from_R(R))
    assert wxyz @ wxyz == pytest.approx(1.0, abs=1e-12)
    assert wxyz[0] >= 0.0
    assert np.abs(R_from_wxyz(wxyz) - R).max() < 1e-12
    assert np.abs(R_from_wxyz(-3.0 * wxyz) - R).max() < 1e-12


@given(rpys)
def test_roll_pitch_yaw_come_back_up_to_the_gimbals_lock(eta):
    R = R_from_rpy(eta)
    blur = 1e-14 / np.cos(eta[1])
    back = rpy_from_R(R)
    assert np.abs(wrap(back - eta)).max() < 1e-12 + 10.0 * blur
    assert np.abs(R_from_rpy(back) - R).max() < 1e-12 + 10.0 * blur


@given(turns, turns, st.sampled_from((-PI / 2, PI / 2)))
def test_in_the_gimbals_lock_the_rotation_still_comes_back(roll, yaw, pitch):
    R = R_from_rpy(np.array([roll, pitch, yaw]))
    back = rpy_from_R(R)
    assert np.isfinite(back).all()
    assert np.abs(R_from_rpy(back) - R).max() < 1e-8


@given(rpys)
def test_rpy_turns_about_x_then_y_then_z_of_the_fixed_axes(eta):
    R = rotation_about_z(eta[2]) @ rotation_about_y(eta[1]) @ rotation_about_x(eta[0])
    assert np.abs(R_from_rpy(eta) - R).max() < 1e-15


@given(rpys, vectors)
def test_S_maps_rates_of_rpy_to_the_numeric_angular_velocity(eta, rates):
    """Eq. (3): [^b ω] = Rᵀ Ṙ and [^a ω] = Ṙ Rᵀ."""
    R, h = R_from_rpy(eta), 1e-3
    stencil = zip((1, 2, 3, 4), (4 / 5, -1 / 5, 4 / 105, -1 / 280), strict=True)
    R_dot = sum(
        k / h * (R_from_rpy(eta + n * h * rates) - R_from_rpy(eta - n * h * rates))
        for n, k in stencil
    )
    assert np.abs(R.T @ R_dot - skew(S_in_b(eta) @ rates)).max() < 1e-11
    assert np.abs(R_dot @ R.T - skew(S_in_a(eta) @ rates)).max() < 1e-11


@given(rpys)
def test_S_in_a_is_S_in_b_turned_and_its_determinant_is_the_cosine_of_pitch(eta):
    assert np.abs(R_from_rpy(eta) @ S_in_b(eta) - S_in_a(eta)).max() < 1e-14
    assert np.linalg.det(S_in_b(eta)) == pytest.approx(np.cos(eta[1]), abs=1e-14)


@given(st.floats(-50.0, 50.0))
def test_wrap_changes_an_angle_by_whole_turns_into_half_open_pi(angle):
    wrapped = float(wrap(np.array(angle)))
    assert -PI < wrapped <= PI
    assert np.remainder((angle - wrapped) / (2.0 * PI) + 0.5, 1.0) == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(("angle", "wrapped"), [(PI, PI), (-PI, PI), (3 * PI, PI), (0.0, 0.0)])
def test_wrap_at_its_borders(angle, wrapped):
    assert float(wrap(np.array(angle))) == pytest.approx(wrapped, abs=1e-15)


@given(unit_vectors, unit_vectors)
def test_the_smallest_rotation_between_directions(a, b):
    R = R_between(a, b)
    assert np.abs(R @ a - b).max() < 1e-7
    angle, turned = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b), log(R)
    assert np.sqrt(turned @ turned) == pytest.approx(angle, abs=1e-7)


@given(unit_vectors)
def test_the_rotation_onto_the_opposite_or_the_same_direction_exists(a):
    assert np.abs(R_between(a, -a) @ a + a).max() < 1e-12
    assert np.array_equal(R_between(a, a), np.eye(3))


@given(rotations)
def test_a_resting_accelerometer_gives_a_level_attitude(R_fc):
    f_in_c = R_fc.T @ np.array([0.0, 0.0, GRAVITY])
    level = R_fc_level_from_specific_force(f_in_c)
    assert np.abs(level @ f_in_c - (0.0, 0.0, GRAVITY)).max() < 1e-6


def test_optical_axes_in_camera_axes():
    forward, right, down = np.eye(3)
    assert np.array_equal(R_co @ np.array([0.0, 0.0, 1.0]), forward)
    assert np.array_equal(R_co @ np.array([1.0, 0.0, 0.0]), -right)
    assert np.array_equal(R_co @ np.array([0.0, 1.0, 0.0]), -down)


@pytest.mark.parametrize("R", [R_co, R_cd_portrait, *(R_cd(angle) for angle in (0, 90, 180, 270))])
def test_changes_of_convention_are_rotations(R):
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-15
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_device_axes_of_an_upright_phone_and_of_one_turned_with_its_screen():
    x, y, z = R_cd(0.0).T
    assert np.array_equal(x, (0.0, -1.0, 0.0))  # to the right of its holder
    assert np.array_equal(y, (0.0, 0.0, 1.0))
    assert np.array_equal(z, (-1.0, 0.0, 0.0))  # out of the screen, to its holder
    assert np.abs(R_cd(90.0)[:, 0] - (0.0, 0.0, 1.0)).max() < 1e-15


def test_the_constants_cannot_be_overwritten():
    with pytest.raises(ValueError, match="read-only"):
        R_co[0, 0] = 1.0
