"""Rolling shutter: what rows saw at different times is carried to one."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.render import RenderOptions, render
from pipeline.camera.lens import COLUMNS, ROWS
from pipeline.camera.rolling_shutter import FrameMotion, unrolled
from pipeline.frames import cross, exp
from pipeline.signals import Frame, Spots
from pipeline.spots.leds import find_spots
from pipeline.vision.detection import FramePrior
from pipeline.vision.vision import Vision
from pipeline.vision_config import LedsConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, error_of, truth_at

ROLLING = replace(CAMERA, readout_s=0.03)
OMEGA, U = np.array([0.3, 0.8, -0.5]), np.array([0.2, 0.3, -0.25])


def moving(truth, t, omega_b=(0.0, 0.0, 0.0)):
    """(R_cb, p_bc_in_c) `t` [s] later: the camera turns, the body flies."""
    turn = exp(-t * OMEGA)
    return turn @ truth.R @ exp(t * np.array(omega_b)), turn @ (truth.p + t * U)


def rolled_pixels(truth, rolling=ROLLING):
    """By fixed point: each LED at the time of its own row."""
    delays = np.zeros(len(LEDS_IN_B))
    for _ in range(20):
        places = [moving(truth, t) for t in delays]
        q = np.array([p + R @ led for (R, p), led in zip(places, LEDS_IN_B, strict=True)])
        pixels = CAMERA.pixels(q)
        delays = rolling.delays(pixels)
    return pixels


def spots_of(pixels):
    n = len(pixels)
    return Spots(pixels, np.tile(np.eye(2), (n, 1, 1)), np.ones(n), np.ones(n))


@pytest.mark.parametrize("axis", [ROWS, COLUMNS])
@pytest.mark.parametrize("readout_s", [0.03, -0.03])
def test_known_motion_puts_the_spots_where_a_global_shutter_would(readout_s, axis):
    rolling = replace(CAMERA, readout_s=readout_s, readout_axis=axis)
    for seed in range(5):
        truth = truth_at(np.random.default_rng(seed))
        rolled, whole = rolled_pixels(truth, rolling), truth.pixels()
        motion = FrameMotion(OMEGA, U, float(truth.p[0]))
        righted = unrolled(rolling, spots_of(rolled), motion).pixels
        before, after = np.abs(rolled - whole).max(), np.abs(righted - whole).max()
        assert after < 0.05 * before


@pytest.mark.parametrize("approach", [-1.5, 0.8])
def test_motion_along_the_line_of_sight_alone_is_taken_out_too(approach):
    """It makes the picture larger row by row: the further from the middle, the more."""
    truth = truth_at(np.random.default_rng(2))
    along, still = np.array([approach, 0.0, 0.0]), np.zeros(3)
    delays = np.zeros(len(LEDS_IN_B))
    for _ in range(20):
        pixels = CAMERA.pixels(truth.p + LEDS_IN_B @ truth.R.T + np.outer(delays, along))
        delays = ROLLING.delays(pixels)
    rolled = spots_of(pixels)
    righted = unrolled(ROLLING, rolled, FrameMotion(still, along, float(truth.p[0]))).pixels
    before = np.abs(pixels - truth.pixels()).max()
    assert before > 0.3
    assert np.abs(righted - truth.pixels()).max() < 0.1 * before
    turning_only = unrolled(ROLLING, rolled, FrameMotion(still, still, float(truth.p[0]))).pixels
    np.testing.assert_array_equal(turning_only, pixels)


def test_without_a_distance_the_cameras_turning_alone_is_taken_out():
    truth = truth_at(np.random.default_rng(3))
    rolled = spots_of(rolled_pixels(truth))
    motion = FrameMotion(OMEGA, np.zeros(3), np.inf)
    righted = unrolled(ROLLING, rolled, motion)
    off = np.abs(righted.pixels - truth.pixels()).max()
    assert off < 0.5 * np.abs(rolled.pixels - truth.pixels()).max()


def test_without_rolling_or_motion_nothing_changes():
    spots = spots_of(truth_at(np.random.default_rng(4)).pixels())
    assert unrolled(CAMERA, spots, FrameMotion(OMEGA, U, 2.0)) is spots
    assert unrolled(ROLLING, spots, None) is spots


def test_the_renderer_draws_each_led_at_its_rows_time():
    truth = truth_at(np.random.default_rng(5))
    look = RenderOptions(exposure_s=0.001)
    rng = np.random.default_rng(6)
    luma = render(ROLLING, lambda t: moving(truth, t), LEDS_IN_B, look, rng)
    spots = find_spots(Frame(0.0, luma), LedsConfig())
    off = np.linalg.norm(spots.pixels[None] - rolled_pixels(truth)[:, None], axis=2).min(axis=1)
    assert off.max() < 0.15
    assert np.abs(rolled_pixels(truth) - truth.pixels()).max() > 2.0


@pytest.mark.parametrize("knows", [True, False])
def test_vision_sees_through_the_shutter_and_without_the_motion_less_often(knows):
    rng = np.random.default_rng(7)
    errors = []
    for _ in range(6):
        truth = truth_at(rng)

        def pose(t, truth=truth):
            return moving(truth, t)

        eye, known = Vision(ROLLING, LEDS_IN_B), truth.prior()
        prior = replace(known, omega_cf_in_c=OMEGA if knows else None)
        luma = render(ROLLING, pose, LEDS_IN_B, RenderOptions(), rng)
        detection = eye.step(Frame(0.0, luma), prior)
        if detection.pose is None:
            assert not knows
            continue
        errors.append(np.abs(error_of(detection.pose, truth)))
    assert errors
    assert np.median(errors, axis=0).max() < 0.01


def test_rays_stay_as_the_rows_saw_them():
    truth = truth_at(np.random.default_rng(8))
    luma = render(
        ROLLING, lambda t: moving(truth, t), LEDS_IN_B, RenderOptions(), np.random.default_rng(9)
    )
    prior = FramePrior(*(truth.prior().up_in_c, truth.prior().up_in_b), OMEGA, np.zeros(3))
    rays = Vision(ROLLING, LEDS_IN_B).step(Frame(4.0, luma), prior).rays
    for led, t, tangents in zip(rays.led, rays.t, rays.tangents, strict=True):
        R, p = moving(truth, t - 4.0)
        q = p + R @ LEDS_IN_B[led]
        np.testing.assert_allclose(tangents, q[1:] / q[0], atol=2e-4)
        assert t != 4.0
    assert len(rays) >= 4


def test_the_flow_is_that_of_a_point_that_moves_in_turning_axes():
    q = np.array([[2.0, 0.3, -0.2]])
    small = replace(CAMERA, readout_s=1e-4)
    pixels = small.pixels(q)
    rate = U - cross(OMEGA, q[0])
    moved = small.pixels(q - rate * small.delays(pixels)[:, None])
    righted = unrolled(small, spots_of(pixels), FrameMotion(OMEGA, U, 2.0)).pixels
    np.testing.assert_allclose(righted, moved, atol=1e-5)
