"""Rays: what a lens and a shutter did is taken out, and what is left is as sure as it says."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.camera.lens import Camera
from pipeline.signals import Match, Spots
from pipeline.vision.rays import NO_RAYS, rays_of
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, rays_at, truth_at

FISHEYE = Camera(1280, 720, CAMERA.K, "equidistant", np.array([0.05, -0.02, 0.01, 0.0]))
CAMERAS = {"plumb bob": CAMERA, "equidistant": FISHEYE}


def spots_of(pixels, covariance):
    n = len(pixels)
    return Spots(pixels, np.tile(covariance, (n, 1, 1)), np.ones(n), np.ones(n))


def all_of(n):
    return Match(np.arange(n), np.arange(n))


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_rays_point_where_the_leds_are(camera):
    truth = truth_at(np.random.default_rng(1))
    pixels = camera.pixels(truth.p + LEDS_IN_B @ truth.R.T)
    rays = rays_of(camera, spots_of(pixels, np.eye(2)), all_of(len(pixels)), 3.0)
    expected = rays_at(3.0, truth.p, truth.R)
    np.testing.assert_allclose(rays.tangents, expected.tangents, atol=1e-6)
    np.testing.assert_array_equal(rays.led, expected.led)
    np.testing.assert_array_equal(rays.t, expected.t)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_their_covariance_is_how_pixels_that_scatter_scatter_them(camera):
    rng = np.random.default_rng(2)
    covariance = np.array([[0.09, 0.02], [0.02, 0.04]])
    corner = np.array([[1100.0, 80.0]])
    scattered = corner + rng.multivariate_normal(np.zeros(2), covariance, 20_000)
    found = np.cov(rays_of(camera, spots_of(scattered, covariance), all_of(20_000), 0.0).tangents.T)
    (claimed,) = rays_of(camera, spots_of(corner, covariance), all_of(1), 0.0).covariances
    np.testing.assert_allclose(claimed, found, rtol=0.05, atol=0.02 * np.abs(found).max())


def test_slopes_are_the_derivative_of_the_normalised_coordinates():
    pixels = np.array([[20.0, 30.0], [640.0, 360.0], [1250.0, 700.0]])
    for camera in CAMERAS.values():
        for axis in range(2):
            step = 1e-3 * np.eye(2)[axis]
            ahead, behind = camera.normalised(pixels + step), camera.normalised(pixels - step)
            difference = (ahead - behind) / 2e-3
            np.testing.assert_allclose(camera.slopes(pixels)[:, :, axis], difference, atol=1e-8)


def test_names_are_kept_and_doubt_multiplies_the_covariance():
    spots = spots_of(np.array([[100.0, 200.0], [300.0, 400.0], [500.0, 600.0]]), np.eye(2))
    match = Match(np.array([4, 1]), np.array([2, 0]))
    sure, unsure = (rays_of(CAMERA, spots, match, 0.0, scale) for scale in (1.0, 9.0))
    np.testing.assert_array_equal(sure.led, [4, 1])
    np.testing.assert_allclose(sure.tangents, -CAMERA.normalised(spots.pixels[[2, 0]]))
    np.testing.assert_allclose(unsure.covariances, 9.0 * sure.covariances)


def test_each_led_is_dated_by_its_row():
    camera = replace(CAMERA, readout_s=0.02)
    pixels = np.array([[5.0, 0.0], [5.0, 360.0], [5.0, 720.0]])
    rays = rays_of(camera, spots_of(pixels, np.eye(2)), all_of(3), 7.0)
    np.testing.assert_allclose(rays.t, [6.99, 7.0, 7.01])


def test_no_rays_have_the_shapes_of_rays():
    none = rays_of(CAMERA, spots_of(np.zeros((0, 2)), np.eye(2)), all_of(0), 0.0)
    for name in ("led", "t", "tangents", "covariances"):
        assert getattr(none, name).shape == getattr(NO_RAYS, name).shape


def test_half_the_field_is_what_the_focal_length_makes_of_the_size():
    to_the_side, up = CAMERA.half_field
    assert to_the_side == pytest.approx(640.0 / 930.0)
    assert up == pytest.approx(360.0 / 931.5)
