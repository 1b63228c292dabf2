"""A phone that films fiducials knows where it is before the glass, smoothly and ahead."""

import numpy as np
import pytest

from hardware.plant_parameters import StartParameters
from hardware.sim.glass_film import film
from hardware.sim.hand import make_hand
from pipeline.camera.lens import Camera
from pipeline.frames import R_from_rpy
from pipeline.glass.eye import EyeTracker
from pipeline.glass.fiducials import FiducialDetector, glass_seen
from pipeline.glass.window import Glass, on_glass, seen_through
from pipeline.signals import PhoneImu

GLASS = Glass(0.53, 0.30)
K = np.array([[950.0, 0.0, 639.5], [0.0, 950.0, 359.5], [0.0, 0.0, 1.0]])
CAMERA = Camera(1280, 720, K, "plumb_bob", np.zeros(5))
DOTS = np.array([[-0.03, 0.05], [0.04, -0.05], [-0.06, -0.03], [0.05, 0.03], [0.0, 0.02]])
PITCH = 0.2
"""Of a laptop's lid [rad]."""
R_fg = R_from_rpy(np.array([0.0, PITCH, 0.0]))


def looking(rpy, eye_in_g):
    """(R_cg, p_gc_in_c) of a camera at `eye_in_g`, turned by `rpy` from straight ahead."""
    R_gc = R_from_rpy(np.array(rpy))
    return R_gc.T, -R_gc.T @ np.array(eye_in_g)


def picture(at, seed=0, grey=70):
    return film(CAMERA, lambda _: at, GLASS, DOTS, np.random.default_rng(seed), grey)


@pytest.mark.parametrize("grey", [40, 70, 115])
@pytest.mark.parametrize(
    ("rpy", "eye"),
    [((0, 0, 0), (-0.6, 0, 0)), ((0.1, 0.1, -0.1), (-0.7, 0.1, 0.1)), ((0, 0, 0), (-1.0, 0, 0))],
)
def test_the_eye_is_found_to_some_millimetres(rpy, eye, grey):
    at = looking(rpy, eye)
    seen = glass_seen(CAMERA, GLASS, *FiducialDetector().find(picture(at, grey=grey)), 0.0)
    assert seen is not None
    assert len(seen.rays) >= 12
    assert np.abs(seen.pose.R_cb.T @ seen.pose.p_bc_in_c + eye).max() < 4e-3


def test_a_mirrored_picture_has_no_glass_in_it():
    mirrored = picture(looking((0, 0, 0), (-0.6, 0, 0)))[:, ::-1]
    numbers, _ = FiducialDetector().find(mirrored)
    assert len(numbers) == 0


def test_a_glass_that_is_followed_is_found_as_one_that_is_searched_for():
    followed = FiducialDetector()
    for k in range(6):
        image = picture(looking((0, 0.02 * k, 0.03 * k), (-0.6, 0.01 * k, 0)), seed=k)
        numbers, pixels = followed.find(image)
        alone, places = FiducialDetector().find(image)
        order, same = np.argsort(numbers), np.argsort(alone)
        np.testing.assert_array_equal(numbers[order], alone[same])
        np.testing.assert_allclose(pixels[order], places[same], atol=0.1)


def test_one_marker_alone_tells_nothing():
    numbers, pixels = FiducialDetector().find(picture(looking((0, 0, 0), (-0.6, 0, 0))))
    assert glass_seen(CAMERA, GLASS, numbers[:4], pixels[:4], 0.0) is None


def test_a_ray_through_a_pixel_meets_the_glass_where_the_light_is():
    R_cg, p_gc_in_c = looking((0.1, -0.1, 0.15), (-0.6, 0.1, 0.05))
    rays_in_g = (p_gc_in_c + on_glass(DOTS) @ R_cg.T) @ R_cg
    assert np.allclose(seen_through(np.array([-0.6, 0.1, 0.05]), rays_in_g), DOTS)


def corners(hand, t):
    """Pixels (16, 2) of the fiducials' corners at `t` [s]."""
    R_fc, p_cf_in_f = hand.pose(t)
    return CAMERA.pixels((GLASS.fiducials() @ R_fg.T - p_cf_in_f) @ R_fc)


def followed(seed, seconds=6.0, readout_s=0.0, late_s=0.0, every=2):
    """Errors (n, 3) [m] of the eye 50 ms ahead of the newest news, and the tracker.

    The camera reads its lines in `readout_s`, and its pictures are stamped so much too late, which
    nobody was told. Each `every`-th sample of motion comes with a picture, 60 a second.
    """
    start = StartParameters(0.6, 0.0, 0.0)
    hand, rng = make_hand("moving", seed=seed, start=start), np.random.default_rng(seed)
    eye, errors = EyeTracker(GLASS), []
    for k in range(int(60 * seconds)):
        t = k / 60.0
        omega = hand.omega_in_c(t) + 0.001 * rng.standard_normal(3)
        force = hand.specific_force_in_c(t) + 0.05 * rng.standard_normal(3)
        eye.add_phone_imu(PhoneImu(t, omega, force))
        if k % every == 0:
            pixels = corners(hand, t)
            if readout_s:
                speed = (corners(hand, t + 1e-3) - pixels) / 1e-3
                pixels = pixels + (pixels[:, 1:] / CAMERA.height - 0.5) * readout_s * speed
            noisy = pixels + 0.15 * rng.standard_normal(pixels.shape)
            seen = glass_seen(CAMERA, GLASS, np.arange(16), noisy, t + late_s)
            eye.add_seen(seen, t + max(0.02, late_s))
        now = t + max(0.02, late_s)
        found = eye.at(now)
        if found is not None and t > 3.0:
            ahead = now + 0.03
            errors.append(found.at(ahead) - R_fg.T @ hand.pose(ahead)[1])
    return np.array(errors), eye


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1000, 1001])
def test_the_eye_is_smooth_and_ahead_of_its_pictures(seed):
    errors, eye = followed(seed)
    assert len(errors) > 150
    assert np.sqrt((errors**2).sum(axis=1).mean()) < 5e-3
    assert np.abs(np.diff(errors, axis=0)).max() < 2e-3
    assert np.abs(eye.up_in_g - R_fg.T @ [0.0, 0.0, 1.0]).max() < 0.01
    assert eye.at(6.02).is_sure


@pytest.mark.slow
def test_an_eye_by_six_pictures_a_second_is_as_sure():
    errors, eye = followed(1000, every=10)
    assert np.sqrt((errors**2).sum(axis=1).mean()) < 5e-3
    assert eye.at(6.02).is_sure


@pytest.mark.slow
@pytest.mark.parametrize(
    ("late_s", "seconds"), [(-0.012, 6.0), (0.0, 6.0), (0.012, 6.0), (-0.05, 8.0), (0.03, 8.0)]
)
def test_a_glass_that_stands_still_tells_when_its_pictures_were_taken(late_s, seconds):
    _, eye = followed(1000, seconds=seconds, late_s=late_s)
    offset = eye.time_offset
    assert offset is not None
    assert abs(offset.value + late_s) < 1e-3
    assert abs(offset.value + late_s) < 4.0 * offset.sigma


@pytest.mark.slow
def test_a_filter_that_is_sure_of_a_wrong_time_is_not_believed_alone():
    _, eye = followed(1000, seconds=3.4, late_s=-0.07)
    learnt = eye._filter.time_offset
    assert learnt.sigma < 2e-3
    assert abs(learnt.value - 0.07) > 0.03
    assert eye.time_offset is None


def test_nobody_knows_when_pictures_were_taken_before_the_first_of_them():
    assert EyeTracker(GLASS).time_offset is None


@pytest.mark.slow
def test_an_eye_without_pictures_is_soon_nobodys():
    _, eye = followed(1002, seconds=3.0)
    assert eye.at(3.05).is_sure
    assert not eye.at(3.3).is_sure


@pytest.mark.slow
def test_what_lines_of_an_unknown_shutter_say_is_no_step_of_a_glass_that_rests():
    for seed in (1000, 1001):
        errors, eye = followed(seed, readout_s=0.02)
        assert not (eye._filter._bias_steps.t_moved[:2] > 0.0).any()
        assert np.abs(np.diff(errors, axis=0)).max() < 4e-3
