"""Light behind glass is seen where it is, by whoever looks from where it is drawn for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.frames import R_from_rpy
from pipeline.glass.window import Glass, Hanging, on_glass, pierced, seen_through

near = st.floats(-0.3, 0.3)


@given(st.tuples(st.floats(-1.5, -0.2), near, near), st.tuples(st.floats(-0.15, 0.3), near, near))
def test_a_dot_lies_in_the_direction_of_its_light(eye, light):
    eye, light = np.array(eye), np.array(light)
    dot = on_glass(pierced(eye, light[None]))[0]
    assert np.abs(np.cross(dot - eye, light - eye)).max() < 1e-9
    assert (dot - eye) @ (light - eye) > 0.0


def test_light_in_the_glass_is_drawn_where_it_is_for_any_eye():
    places = np.array([[0.1, -0.05], [-0.2, 0.08]])
    for eye in ([-0.5, 0.1, 0.2], [-1.2, -0.4, 0.0]):
        assert np.allclose(pierced(np.array(eye), on_glass(places)), places)


def test_an_error_of_the_eye_moves_light_by_its_depth_over_the_distance():
    eye, light, error = np.array([-0.6, 0.0, 0.0]), np.array([[0.06, 0.0, 0.0]]), 0.01
    moved = pierced(eye + np.array([0.0, error, 0.0]), light) - pierced(eye, light)
    assert moved[0, 0] == pytest.approx(-error * 0.06 / 0.66)


@pytest.mark.parametrize(
    ("eye", "light"),
    [([0.2, 0, 0], [0.5, 0, 0]), ([-0.5, 0, 0], [-0.7, 0, 0]), ([-0.5, 0, 0], [-0.49, 0, 0])],
    ids=["behind the glass", "light behind the eye", "light at the eye"],
)
def test_what_cannot_be_seen_is_drawn_nowhere(eye, light):
    dots = pierced(np.array(eye, dtype=float), np.array([light], dtype=float))
    assert np.isnan(dots).all()
    assert not Glass(0.5, 0.3).has(dots).any()


def test_fiducials_are_on_the_glass_and_leave_its_middle_free():
    glass = Glass(0.53, 0.3)
    places = seen_through(np.array([-1.0, 0.0, 0.0]), glass.fiducials() + np.array([1.0, 0.0, 0.0]))
    assert glass.has(places).all()
    assert (np.abs(places) > 0.5 * 0.3 - glass.tile_m).any(axis=1).all()
    top_left, top_right = places[0], places[4 + 1]
    assert np.allclose(top_left, [-top_right[0], top_right[1]])
    assert top_left[0] < 0.0 < top_left[1]


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 0.0), (0.02, 0.35, 0.0), (-0.1, -0.2, 0.0)])
def test_a_robot_hangs_upright_behind_a_tilted_glass(rpy):
    R_fg, leds_in_b = R_from_rpy(np.array(rpy)), np.random.default_rng(0).normal(size=(5, 3))
    hanging = Hanging.of(R_fg.T @ [0.0, 0.0, 1.0], leds_in_b)
    lifted = hanging.leds_in_g(np.eye(3), np.array([0.0, 0.0, 1.0]), leds_in_b)
    at_rest = hanging.leds_in_g(np.eye(3), np.zeros(3), leds_in_b)
    assert np.allclose(lifted - at_rest, R_fg.T @ [0.0, 0.0, 1.0])
    assert np.allclose(at_rest.mean(axis=0), 0.0)
