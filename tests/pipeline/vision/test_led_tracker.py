"""Following a robot whose place is foreseen: names, poses, and what is learnt on the way."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.render import RenderOptions, render
from pipeline.camera.rolling_shutter import FrameMotion
from pipeline.frames import exp
from pipeline.identification.pnp import pose_of
from pipeline.signals import Frame
from pipeline.spots.noise_scale import NoiseScale
from pipeline.spots.spot_kernels import measure
from pipeline.vision.led_tracker import THREE_IN_A_ROW, LedTracker
from pipeline.vision.motion_blur import MotionBlur
from tests.pipeline.seeing import (
    CAMERA,
    LEDS_IN_B,
    error_of,
    frame_at,
    is_wrong,
    moved,
    truth_at,
)
from tests.pipeline.spotting import seen, spots_of

STILL = FrameMotion(np.zeros(3), np.zeros(3), 2.5)


def named(truth, spots, foreseen, follower=None):
    follower = follower or LedTracker(CAMERA, LEDS_IN_B)
    return follower.name(spots, (foreseen.p, foreseen.R), None)


def names_truly(association, truth, spots):
    at = truth.pixels()[association.match.led]
    near = np.linalg.norm(spots.pixels[association.match.spot] - at, axis=1).max() < 1.0
    return near and not is_wrong(pose_of(association.fit, 0.0), truth)


def test_what_moved_together_is_named():
    rng = np.random.default_rng(39)
    for _ in range(20):
        before = truth_at(rng)
        now = moved(before, rng, dp=0.02)
        spots = seen(now, rng, lamps=4)
        association = named(now, spots, before)
        assert names_truly(association, now, spots)
        assert len(association.match.led) == 5


@pytest.mark.parametrize("covered", range(5))
def test_a_covered_led_is_preferred_to_a_lamp_beside_it(covered):
    rng = np.random.default_rng(40)
    before = truth_at(rng)
    now = moved(before, rng)
    pixels = now.pixels()
    pixels[covered] += (9.0, -7.0)
    association = named(now, spots_of(pixels), before)
    assert covered not in association.match.led
    assert not is_wrong(pose_of(association.fit, 0.0), now)


def test_three_leds_do_for_a_while_two_never():
    rng = np.random.default_rng(41)
    truth = truth_at(rng)
    follower = LedTracker(CAMERA, LEDS_IN_B)
    three, two = seen(truth, rng, leds=(0, 1, 3)), seen(truth, rng, leds=(0, 3))
    assert named(truth, two, truth, follower) is None
    for _ in range(THREE_IN_A_ROW):
        association = named(truth, three, truth, follower)
        assert not is_wrong(pose_of(association.fit, 0.0), truth)
    assert named(truth, three, truth, follower) is None


def test_three_leds_and_a_lamp_that_could_be_one_are_not_enough():
    rng = np.random.default_rng(42)
    truth = truth_at(rng)
    pixels = truth.pixels()[[0, 1, 3]]
    spots = spots_of(np.vstack((pixels, pixels[1] + (6.0, 4.0))))
    assert named(truth, spots, truth) is None


def test_nothing_seen_is_nothing_named():
    truth = truth_at(np.random.default_rng(43))
    assert named(truth, spots_of(np.zeros((0, 2))), truth) is None
    dark = Frame(0.0, np.zeros((CAMERA.height, CAMERA.width), np.uint8))
    assert LedTracker(CAMERA, LEDS_IN_B).look(dark, (truth.p, truth.R), None).association is None


def test_who_jumps_is_another():
    rng = np.random.default_rng(44)
    truth = truth_at(rng)
    far = replace(truth, p=truth.p + np.array([0.4, 0.0, 0.0]))
    assert named(truth, seen(truth, rng), far) is None


def test_a_picture_gives_a_pose_to_a_tenth_of_a_millimetre():
    rng = np.random.default_rng(45)
    follower, truth = LedTracker(CAMERA, LEDS_IN_B), truth_at(rng)
    errors = []
    for k in range(8):
        foreseen = truth
        truth = moved(truth, rng)
        frame = frame_at(0.03 * k, truth, rng)
        followed = follower.look(frame, (foreseen.p, foreseen.R), STILL)
        errors.append(np.abs(error_of(pose_of(followed.association.fit, 0.0), truth)))
    assert (np.median(errors, axis=0) < [5e-4, 1e-4, 1e-4, 5e-4, 5e-4, 5e-4]).all()
    assert len(measure.signatures) == 1


def test_a_turn_that_changes_is_taken_out_of_a_rolling_shutter():
    """The camera's turning changes so fast that its rate alone is off by half a pixel."""
    rng = np.random.default_rng(46)
    rolling, truth = replace(CAMERA, readout_s=0.03), truth_at(rng)
    omega, alpha = np.array([0.2, 0.5, -0.4]), np.array([1.0, 8.0, -6.0])
    follower, errors = LedTracker(rolling, LEDS_IN_B), []
    for k in range(-2, 1):
        t = k / 30.0

        def pose(dt, t=t):
            s = t + dt
            turn = exp(-(omega * s + 0.5 * alpha * s * s))
            return turn @ truth.R, turn @ truth.p

        R, p = pose(0.0)
        motion = FrameMotion(omega + alpha * t, np.zeros(3), 2.5)
        luma = render(rolling, pose, LEDS_IN_B, RenderOptions(exposure_s=0.001), rng)
        association = follower.look(Frame(t, luma), (p, R), motion).association
        errors.append(np.linalg.norm(pose_of(association.fit, 0.0).p_bc_in_c - p))
    assert errors[-1] < 0.5 * errors[0]


def test_an_exposure_is_learnt_from_how_far_moving_spots_are_blurred():
    rng = np.random.default_rng(47)
    truth, omega = truth_at(rng), np.array([0.1, 0.9, 0.6])
    follower, look = (
        LedTracker(CAMERA, LEDS_IN_B),
        RenderOptions(exposure_s=0.015, sub_exposures=24),
    )
    for k in range(4):
        luma = render(
            CAMERA, lambda t: (exp(-omega * t) @ truth.R, exp(-omega * t) @ truth.p), LEDS_IN_B,
            look, rng,
        )  # fmt: skip
        follower.look(
            Frame(0.03 * k, luma), (truth.p, truth.R), FrameMotion(omega, np.zeros(3), 2.5)
        )
    assert follower.motion_blur.exposure_s == pytest.approx(look.exposure_s, rel=0.15)
    assert MotionBlur().exposure_s == 0.0


def test_doubt_follows_the_residuals_and_forgets_one_outlier():
    rng = np.random.default_rng(48)
    noise_scale = NoiseScale()
    assert noise_scale.factor == 1.0
    for chi2 in rng.chisquare(4, 300):
        noise_scale.learn(6.0 * chi2, 4)
    settled = noise_scale.factor
    assert settled == pytest.approx(6.0, rel=0.3)
    noise_scale.learn(1e9, 4)
    assert noise_scale.factor < 1.6 * settled
