"""The compiled lens against OpenCV's, and against itself."""

import cv2
import numpy as np
import pytest

from pipeline.camera.lens import Camera, points_of
from pipeline.camera.lens_kernels import bend, unbend

K = np.array([[930.0, 0.0, 646.0], [0.0, 931.5, 354.0], [0.0, 0.0, 1.0]])
LENSES = {
    "plumb_bob": (0.06, -0.11, 0.0006, -0.0004, 0.01),
    "plumb_bob of four": (0.06, -0.11, 0.0006, -0.0004),
    "barrel": (-0.31, 0.12, 0.0006, -0.0004, -0.02),
    "rational_polynomial": (0.5, 0.1, 0.0005, -0.0003, 0.02, 0.45, 0.15, 0.03),
    "equidistant": (-0.02, 0.01, -0.004, 0.001),
}


def camera(name):
    model = name if name in ("rational_polynomial", "equidistant") else "plumb_bob"
    return Camera(1280, 720, K, model, np.array(LENSES[name]))


def everywhere():
    u, v = np.meshgrid(np.linspace(-0.65, 0.65, 21), np.linspace(-0.38, 0.38, 15))
    return np.column_stack((u.ravel(), v.ravel()))


def by_opencv(lens, points):
    zero = np.zeros(3)
    in_o = np.column_stack((points, np.ones(len(points)))).reshape(-1, 1, 3)
    project = cv2.fisheye.projectPoints if lens.model == "equidistant" else cv2.projectPoints
    return project(in_o, zero, zero, lens.K, lens.distortion)[0].reshape(-1, 2)


@pytest.mark.parametrize("name", LENSES)
def test_pixels_are_those_of_opencv(name):
    lens, points = camera(name), everywhere()
    ours = lens.pixels(3.0 * points_of(points))
    np.testing.assert_allclose(ours, by_opencv(lens, points), atol=1e-9, rtol=0.0)


@pytest.mark.parametrize("name", LENSES)
def test_points_are_those_of_opencv_and_the_exact_inverse(name):
    lens, points = camera(name), everywhere()
    pixels = lens.pixels(points_of(points))
    np.testing.assert_allclose(lens.normalised(pixels), points, atol=1e-11, rtol=0.0)
    if lens.model == "equidistant":
        theirs = cv2.fisheye.undistortPoints(pixels[:, None], lens.K, lens.distortion)
    else:
        until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
        theirs = cv2.undistortPoints(
            pixels[:, None], lens.K, lens.distortion, None, None, None, until
        )
    middle = np.abs(points).max(axis=1) < 0.5  # OpenCV's iteration ends early in the corners
    ours = lens.normalised(pixels)[middle]
    np.testing.assert_allclose(ours, theirs.reshape(-1, 2)[middle], atol=1e-9, rtol=0.0)


@pytest.mark.parametrize("name", LENSES)
def test_the_derivatives_are_those_of_the_lens(name):
    lens, step, out = camera(name).lens, 1e-6, np.empty(6)
    ahead, behind = np.empty(6), np.empty(6)
    for x, y in everywhere()[::7]:
        bend(lens, x, y, out)
        for axis, (dx, dy) in enumerate(((step, 0.0), (0.0, step))):
            bend(lens, x + dx, y + dy, ahead)
            bend(lens, x - dx, y - dy, behind)
            slope = (ahead[:2] - behind[:2]) / (2.0 * step)
            np.testing.assert_allclose(out[[2 + axis, 4 + axis]], slope, atol=1e-8)


def test_a_pixel_that_no_point_is_seen_at_is_told_and_finite():
    """A barrel so strong that its picture ends before the corner."""
    lens = Camera(1280, 720, K, "plumb_bob", np.array([-0.9, 0.0, 0.0, 0.0])).lens
    out = np.empty(6)
    assert not unbend(lens, 2000.0, 1500.0, out)
    assert np.isfinite(out).all()
    assert unbend(lens, 700.0, 400.0, out)
