from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.camera.extrinsics import Extrinsics
from pipeline.camera.lens import COLUMNS, ROWS, Camera, R_turned, points_of
from pipeline.frames import R_cd, exp

K = np.array([[930.0, 0.0, 646.0], [0.0, 931.5, 354.0], [0.0, 0.0, 1.0]])
LENSES = {
    "plumb_bob": (0.06, -0.11, 0.0006, -0.0004, 0.01),
    "rational_polynomial": (0.5, 0.1, 0.0005, -0.0003, 0.02, 0.45, 0.15, 0.03),
    "equidistant": (-0.02, 0.01, -0.004, 0.001),
}


def camera(model="plumb_bob", distortion=None):
    return Camera(1280, 720, K, model, np.array(distortion or LENSES[model]))


@pytest.mark.parametrize("model", LENSES)
def test_a_projected_point_is_found_on_its_ray_again(model):
    u, v = np.meshgrid(np.linspace(-0.55, 0.55, 9), np.linspace(-0.3, 0.3, 7))
    normalised = np.column_stack((u.ravel(), v.ravel()))
    points = points_of(normalised) * np.linspace(0.5, 9.0, len(normalised))[:, None]
    back = camera(model).normalised(camera(model).pixels(points))
    np.testing.assert_allclose(back, normalised, atol=2e-5)


@pytest.mark.parametrize("model", LENSES)
def test_distortion_moves_the_corners_and_leaves_the_middle(model):
    none = camera(model, (0.0,) * len(LENSES[model]))
    points = np.array([[1.0, 0.0, 0.0], [1.0, 0.5, 0.3]])
    shift = np.linalg.norm(camera(model).pixels(points) - none.pixels(points), axis=1)
    assert shift[0] < 1e-6 < 1.0 < shift[1]


def test_left_is_left_and_up_is_up_in_the_picture():
    ahead, left, above = camera().pixels(np.array([[2.0, 0, 0], [2.0, 0.1, 0], [2.0, 0, 0.1]]))
    np.testing.assert_allclose(ahead, K[:2, 2], atol=1e-9)
    assert left[0] < ahead[0]
    assert above[1] < ahead[1]


@pytest.mark.parametrize("model", LENSES)
def test_one_point_is_one_row_and_no_point_is_none(model):
    lens = camera(model)
    for n in (0, 1):
        assert lens.pixels(np.full((n, 3), 0.5)).shape == (n, 2)
        assert lens.normalised(np.full((n, 2), 300.0)).shape == (n, 2)


def test_the_picture_ends_half_a_pixel_beyond_its_last_pixels():
    corners = np.array([[-0.4, -0.4], [1279.4, 719.4], [-0.6, 10.0], [10.0, 719.6]])
    assert camera().sees(corners).tolist() == [True, True, False, False]
    assert camera().sees(np.array([[9.0, 300.0], [10.0, 300.0]]), 10.0).tolist() == [False, True]


def test_the_mean_focal_length_counts():
    assert camera().focal_px == pytest.approx(930.75)


@pytest.mark.parametrize("model", LENSES)
def test_in_a_picture_made_smaller_each_point_keeps_its_share_of_width_and_height(model):
    points = np.array([[1.0, 0.0, 0.0], [1.0, 0.4, -0.2], [2.0, -0.7, 0.4]])
    small = camera(model).resized(640, 360)
    assert (small.width, small.height) == (640, 360)
    edges = 0.5 * (camera(model).pixels(points) + 0.5)
    np.testing.assert_allclose(small.pixels(points) + 0.5, edges, rtol=1e-12)
    same = camera(model)
    assert same.resized(1280, 720) is same


def test_a_camera_of_another_picture_size_keeps_all_else_it_knows():
    turned = Extrinsics(R_ci=np.diag([1.0, -1.0, -1.0]), time_offset_s=0.012)
    whole = replace(camera(), readout_s=-0.02, extrinsics=turned)
    small = whole.resized(640, 360)
    kept = {one.name for one in fields(Camera)} - {"width", "height", "K", "lens"}
    assert {name for name in kept if getattr(small, name) is not getattr(whole, name)} == set()


def clockwise(pixels, height):
    return np.column_stack((height - 1.0 - pixels[:, 1], pixels[:, 0]))


@pytest.mark.parametrize("readout_s", [0.02, -0.02])
@pytest.mark.parametrize("model", LENSES)
def test_a_turned_camera_sees_the_turned_picture_line_for_line(model, readout_s):
    points = points_of(np.random.default_rng(0).uniform(-0.3, 0.3, (20, 2)))
    whole = replace(camera(model), readout_s=readout_s)
    pixels, delays, height = whole.pixels(points), whole.delays(whole.pixels(points)), 720
    for quarters in range(1, 5):
        pixels, height = clockwise(pixels, height), 2000 - height  # 1280 and 720
        turned = whole.turned(quarters)
        there = points @ R_turned(quarters).T
        np.testing.assert_allclose(turned.pixels(there), pixels, atol=1e-9)
        np.testing.assert_allclose(points_of(turned.normalised(pixels)), there, atol=2e-5)
        np.testing.assert_allclose(turned.delays(pixels), delays, atol=0.02 / 720)
        assert turned.readout_axis == (COLUMNS if quarters % 2 else ROWS)
        assert turned.sees(pixels).all()


@pytest.mark.parametrize("angle", [0, 90, 180, 270])
def test_a_camera_turned_with_the_screen_keeps_its_place_beside_the_motion_sensors(angle):
    mounted = replace(camera(), extrinsics=Extrinsics(exp(np.array([0.1, -0.2, 0.05])), 0.01))
    quarters = (90 - angle) // 90
    there = mounted.turned(quarters).extrinsics
    in_picture = R_turned(quarters) @ mounted.extrinsics.R_ci @ R_cd(90)
    np.testing.assert_allclose(there.R_ci @ R_cd(angle), in_picture, atol=1e-12)
    assert there.time_offset_s == 0.01
