"""What a camera's settings lack for LEDs, from pictures of the simulator."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.render import RenderOptions, render
from pipeline.camera.exposure import ADVICE, BEGIN_S, ExposureHint, ExposureMonitor
from pipeline.camera.exposure_kernels import CLIPPED, CONTRAST, UU, VV, put_exposures
from pipeline.camera.lens import Camera
from pipeline.frames import exp
from pipeline.signals import Frame

FOCAL = 450.0
CAMERA = Camera(
    320,
    240,
    np.array([[FOCAL, 0.0, 159.5], [0.0, FOCAL, 119.5], [0.0, 0.0, 1.0]]),
    "plumb_bob",
    np.zeros(5),
)
LEDS = np.array([[0.0, 0.2, 0.1], [0.1, -0.2, 0.0], [0.0, 0.05, -0.15]])
PLACE = np.array([1.2, 0.0, 0.0])
GOOD = RenderOptions(led_radius_m=0.004, led_light=2.0)
STILL, PAN = np.zeros(3), np.array([0.0, 0.0, 1.0])
DT = 1.0 / 30.0


def picture(look, omega=STILL, rng=None):
    def pose(dt):
        turn = exp(-omega * dt)
        return turn, turn @ PLACE

    return render(CAMERA, pose, LEDS, look, rng or np.random.default_rng(0))


def watched(look, n=60, omega=STILL, watch=None, t=0.0):
    watch = watch or ExposureMonitor(FOCAL)
    frame, pixels = picture(look, omega), CAMERA.pixels(PLACE + LEDS)
    for k in range(n):
        watch.see(Frame(t + DT * k, frame), pixels, float(PLACE[0]), omega)
    return watch


def test_a_good_picture_lacks_nothing():
    assert watched(GOOD).hint is ExposureHint.NONE


@pytest.mark.parametrize(
    ("look", "hint"),
    [
        (replace(GOOD, led_light=300.0, halo=0.05), ExposureHint.TOO_BRIGHT),
        (replace(GOOD, led_light=0.12, room=0.02), ExposureHint.TOO_DIM),
        (replace(GOOD, led_light=1.5, blur_px=5.0), ExposureHint.OUT_OF_FOCUS),
    ],
)
def test_what_is_lacking_is_told_after_a_moment(look, hint):
    assert watched(look).hint is hint
    assert watched(look, n=round(0.5 * BEGIN_S / DT)).hint is ExposureHint.NONE


@pytest.mark.parametrize("exposure_s", [0.004, 0.012, 0.02])
def test_how_long_a_picture_is_exposed_is_seen_by_its_motion_blur(exposure_s):
    look = replace(GOOD, led_light=1.2 * 4.0, exposure_s=exposure_s, sub_exposures=16)
    watch = watched(look, omega=PAN)
    assert watch.exposure_s == pytest.approx(exposure_s, rel=0.35)
    assert watch.hint is (ExposureHint.BLURRED if exposure_s > 0.01 else ExposureHint.NONE)


def test_a_still_phone_says_nothing_of_the_exposure():
    assert watched(GOOD).exposure_s is None


def test_a_hint_goes_when_the_picture_is_good_again_but_not_at_once():
    watch = watched(replace(GOOD, led_light=0.12))
    watched(GOOD, n=20, watch=watch, t=60 * DT)
    assert watch.hint is ExposureHint.TOO_DIM
    watched(GOOD, n=100, watch=watch, t=80 * DT)
    assert watch.hint is ExposureHint.NONE


def test_leds_at_the_border_are_left_out():
    looks = np.ones((2, 5))
    luma = np.full((60, 80), 10, np.uint8)
    luma[28:31, 38:41] = 200
    put_exposures(luma, np.array([[39.0, 29.0], [3.0, 29.0]]), 250.0, looks)
    assert looks[0, [CONTRAST, CLIPPED]].tolist() == [190.0, 0.0]
    assert looks[0, [UU, VV]] == pytest.approx(2.0 / 3.0)
    assert not looks[1].any()
    watch = ExposureMonitor(FOCAL)
    watch.see(Frame(0.0, luma), np.array([[3.0, 29.0]]), 1.0, STILL)
    assert watch.hint is ExposureHint.NONE


def test_limited_range_is_judged_by_its_own_white():
    looks = np.zeros((1, 5))
    luma = np.full((60, 80), 16, np.uint8)
    luma[28:31, 38:41] = 235
    put_exposures(luma, np.array([[39.0, 29.0]]), 232.0, looks)
    assert looks[0, CLIPPED] == 9.0


def test_every_hint_has_its_words():
    assert all(bool(ADVICE[hint]) == (hint is not ExposureHint.NONE) for hint in ExposureHint)
