import numpy as np
import pytest

from pipeline import identify
from pipeline.frames import exp
from pipeline.pnp import pose_of
from pipeline.signals import Spots
from pipeline.vision_config import IdentifyConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, Truth, is_wrong, moved, truth_at

CONFIG = IdentifyConfig()
NOISE_PX = 0.04


def spots_of(pixels, brightness=None):
    """In the order of brightness, as the detector gives them."""
    n = len(pixels)
    brightness = np.ones(n) if brightness is None else np.asarray(brightness, dtype=float)
    order = np.argsort(-brightness, kind="stable")
    covariances = np.tile(NOISE_PX**2 * np.eye(2), (n, 1, 1))
    return Spots(pixels[order], covariances, brightness[order], np.full(n, 20.0))


def seen(truth, rng, leds=range(5), lamps=0):
    """Spots of some LEDs among lamps that are as bright but not on top of them."""
    pixels = truth.pixels()
    lights = [pixels[led] + rng.normal(0.0, NOISE_PX, 2) for led in leds]
    while len(lights) < len(leds) + lamps:
        lamp = rng.uniform(0.05, 0.95, 2) * (CAMERA.width, CAMERA.height)
        if np.linalg.norm(np.vstack((pixels, *lights)) - lamp, axis=1).min() > 25.0:
            lights.append(lamp)
    return spots_of(np.array(lights), rng.uniform(1.0, 2.0, len(lights)))


def with_gravity(truth, spots, tilt=None):
    prior = truth.prior()
    up_in_c = prior.up_in_c if tilt is None else exp(tilt) @ prior.up_in_c
    return identify.from_gravity(CAMERA, LEDS_IN_B, spots, up_in_c, prior.up_in_b, CONFIG)


def names_truly(naming, truth, spots):
    at = truth.pixels()[naming.match.led]
    named = np.linalg.norm(spots.pixels[naming.match.spot] - at, axis=1).max() < 1.0
    return named and not is_wrong(pose_of(naming.fit, 0.0), truth)


def test_gravity_finds_the_robot_among_lamps():
    rng = np.random.default_rng(30)
    for _ in range(25):
        truth = truth_at(rng, rng.uniform(1.5, 4.0))
        spots = seen(truth, rng, lamps=8)
        naming = with_gravity(truth, spots)
        assert names_truly(naming, truth, spots)
        assert len(naming.match.led) == 5


@pytest.mark.parametrize("covered", range(5))
def test_gravity_finds_the_robot_with_one_led_covered(covered):
    rng = np.random.default_rng(31 + covered)
    leds = [led for led in range(5) if led != covered]
    for _ in range(8):
        truth = truth_at(rng)
        spots = seen(truth, rng, leds, lamps=2)
        naming = with_gravity(truth, spots)
        assert names_truly(naming, truth, spots)
        assert covered not in naming.match.led


def test_gravity_may_be_six_degrees_off():
    rng = np.random.default_rng(32)
    found = 0
    for _ in range(25):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=3)
        direction = rng.normal(0.0, 1.0, 3)
        tilt = np.deg2rad(6.0) * direction / np.linalg.norm(direction)
        naming = with_gravity(truth, spots, tilt)
        assert naming is None or names_truly(naming, truth, spots)
        found += naming is not None
    assert found >= 23


def test_lamps_alone_are_no_robot():
    rng = np.random.default_rng(33)
    for _ in range(15):
        truth = truth_at(rng)
        assert with_gravity(truth, seen(truth, rng, leds=(), lamps=5)) is None


def test_three_leds_are_too_few_even_with_gravity():
    rng = np.random.default_rng(34)
    truth = truth_at(rng)
    assert with_gravity(truth, seen(truth, rng, leds=(0, 2, 4))) is None


def test_two_robots_are_two_explanations_and_none_is_told():
    rng = np.random.default_rng(35)
    for _ in range(5):
        truth = truth_at(rng)
        other = Truth(truth.p + np.array([0.4, 1.1, 0.1]), truth.R, truth.R_fc)
        pixels = np.vstack((truth.pixels(), other.pixels()))
        spots = spots_of(pixels + rng.normal(0.0, NOISE_PX, pixels.shape))
        assert with_gravity(truth, spots) is None


def test_a_lamp_beside_an_led_is_not_taken_for_it():
    """Two lights that merge: fits to a pixel, turned by ten degrees, were it not left out."""
    rng = np.random.default_rng(36)
    for _ in range(20):
        truth = truth_at(rng)
        pixels = truth.pixels()
        angle = rng.uniform(0.0, 2.0 * np.pi)
        pixels[rng.integers(5)] += 15.0 * np.array([np.cos(angle), np.sin(angle)])
        naming = with_gravity(truth, spots_of(pixels))
        assert naming is None or not is_wrong(pose_of(naming.fit, 0.0), truth)


def test_without_gravity_all_leds_are_enough():
    rng = np.random.default_rng(37)
    for _ in range(4):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=1)
        naming = identify.from_nothing(CAMERA, LEDS_IN_B, spots, CONFIG)
        assert names_truly(naming, truth, spots)


def test_without_gravity_four_leds_are_not():
    rng = np.random.default_rng(38)
    for lamps in (0, 1):
        spots = seen(truth_at(rng), rng, leds=range(4), lamps=lamps)
        assert identify.from_nothing(CAMERA, LEDS_IN_B, spots, CONFIG) is None


def tracked(truth, spots, predicted):
    return identify.while_tracking(CAMERA, LEDS_IN_B, spots, (predicted.p, predicted.R), CONFIG)


def test_tracking_names_what_moved_together():
    rng = np.random.default_rng(39)
    for _ in range(20):
        before = truth_at(rng)
        now = moved(before, rng, dp=0.02)
        spots = seen(now, rng, lamps=4)
        naming = tracked(now, spots, before)
        assert names_truly(naming, now, spots)
        assert len(naming.match.led) == 5


@pytest.mark.parametrize("covered", range(5))
def test_tracking_prefers_a_covered_led_to_a_lamp_beside_it(covered):
    rng = np.random.default_rng(40)
    before = truth_at(rng)
    now = moved(before, rng)
    pixels = now.pixels()
    pixels[covered] += (9.0, -7.0)
    naming = tracked(now, spots_of(pixels), before)
    assert covered not in naming.match.led
    assert not is_wrong(pose_of(naming.fit, 0.0), now)


def test_tracking_with_two_leds_covered_says_nothing():
    rng = np.random.default_rng(41)
    truth = truth_at(rng)
    assert tracked(truth, seen(truth, rng, leds=(0, 1, 3)), truth) is None


def test_nothing_seen_is_nothing_named():
    rng = np.random.default_rng(42)
    truth, nothing = truth_at(rng), spots_of(np.zeros((0, 2)))
    assert with_gravity(truth, nothing) is None
    assert identify.from_nothing(CAMERA, LEDS_IN_B, nothing, CONFIG) is None
    assert tracked(truth, nothing, truth) is None
