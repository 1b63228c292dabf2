"""A few LEDs, named by what a filter expects: rather no name than a wrong one."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.render import RenderOptions
from pipeline.frames import exp
from pipeline.prediction import Prediction
from pipeline.signals import Frame, Spots
from pipeline.vision.detection import FramePrior
from pipeline.vision.few_leds import name_few, places
from pipeline.vision.vision import Vision
from pipeline.vision_config import IdentifyConfig
from tests.pipeline.seeing import (
    CAMERA,
    LEDS_IN_B,
    frame_at,
    is_wrong,
    moved,
    picture,
    rays_at,
    truth_at,
)

CONFIG = IdentifyConfig()
DT = 1.0 / 30.0
ANY_SIZE = np.nan


def expected_of(truth, sigma_p=0.005, sigma_theta=0.004, rng=None, t=0.0):
    """A filter's honest opinion of the truth: as wrong as it says, if `rng` is given."""
    p, R = truth.p, truth.R
    if rng is not None:
        p = p + rng.normal(0.0, sigma_p, 3)
        R = R @ exp(rng.normal(0.0, sigma_theta, 3))
    return Prediction(t, p, R, np.zeros(3), sigma_p, sigma_theta)


def spots_of(pixels, area=60.0):
    n = len(pixels)
    return Spots(pixels, np.tile(1e-3 * np.eye(2), (n, 1, 1)), np.ones(n), np.full(n, area))


def named(truth, expected, seen, lamps=(), area=ANY_SIZE, **looks):
    """Pairs of an LED and what its name was given to, an LED or a lamp (from 100 on)."""
    where = places(CAMERA, LEDS_IN_B, expected, CONFIG)
    if where is None:
        return {}
    pixels = np.concatenate((truth.pixels()[list(seen)], np.reshape(lamps, (-1, 2))))
    match = name_few(spots_of(pixels, **looks), where, area)
    owners = [*seen, *range(100, 100 + len(pixels) - len(seen))]
    return (
        {}
        if match is None
        else {int(led): owners[spot] for led, spot in zip(match.led, match.spot, strict=True)}
    )


@pytest.mark.parametrize("sigma_p", [0.002, 0.01, 0.025])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_any_few_are_named_rightly_by_an_honest_expectation(count, sigma_p):
    rng = np.random.default_rng(100 + count)
    got = wanted = 0
    for _ in range(200):
        truth = truth_at(rng)
        seen = rng.choice(len(LEDS_IN_B), count, replace=False).tolist()
        names = named(truth, expected_of(truth, sigma_p, rng=rng), seen)
        assert all(led == owner for led, owner in names.items())
        got, wanted = got + len(names), wanted + count
    assert got > 0.85 * wanted


@pytest.mark.parametrize("sigma_p", [0.002, 0.01, 0.025])
def test_among_lamps_and_covered_leds_hardly_a_wrong_name_is_given(sigma_p):
    """Three lamps within reach of the robot, each LED covered or not."""
    rng = np.random.default_rng(110)
    right = wrong = 0
    for _ in range(600):
        truth = truth_at(rng)
        seen = [led for led in range(len(LEDS_IN_B)) if rng.uniform() < 0.4]
        middle = truth.pixels().mean(axis=0)
        lamps = middle + rng.uniform(-150.0, 150.0, (3, 2))
        for led, owner in named(truth, expected_of(truth, sigma_p, rng=rng), seen, lamps).items():
            right, wrong = right + (led == owner), wrong + (led != owner)
    assert right > 200
    assert wrong < 0.06 * right


def test_a_lamp_beside_an_led_leaves_it_without_a_name():
    truth = truth_at(np.random.default_rng(111))
    expected = expected_of(truth, 0.01)
    for led in range(len(LEDS_IN_B)):
        lamp = truth.pixels()[led] + (6.0, -4.0)
        assert named(truth, expected, [led], lamp) == {}
        others = [k for k in range(len(LEDS_IN_B)) if k != led][:1]
        assert led not in named(truth, expected, [led, *others], lamp)


def test_three_that_shift_alike_are_not_confused_by_a_lamp_that_does_not():
    truth = truth_at(np.random.default_rng(112))
    expected = expected_of(truth, 0.01)
    lamp = truth.pixels()[1] + (10.0, -6.0)
    assert named(truth, expected, [0, 1, 2], lamp) == {0: 0, 1: 1, 2: 2}


def test_a_spot_that_might_be_either_of_two_is_neither():
    truth = truth_at(np.random.default_rng(113), distance=5.0)
    pixels = truth.pixels()
    gaps = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    gaps[gaps == 0.0] = np.inf
    one, other = np.unravel_index(np.argmin(gaps), gaps.shape)
    between = 0.5 * (pixels[one] + pixels[other])
    reach_m = 0.6 * gaps[one, other] / CAMERA.focal_px * truth.p[0]
    unsure = expected_of(truth, reach_m / CONFIG.expected_sigmas)
    assert places(CAMERA, LEDS_IN_B, unsure, CONFIG) is not None
    assert named(truth, unsure, [], between) == {}


@pytest.mark.parametrize("area", [10.0, 400.0])
def test_a_spot_of_another_size_is_no_led(area):
    truth = truth_at(np.random.default_rng(114))
    assert named(truth, expected_of(truth), [0, 3], area=60.0) == {0: 0, 3: 3}
    where = places(CAMERA, LEDS_IN_B, expected_of(truth), CONFIG)
    assert name_few(spots_of(truth.pixels()[:1], area), where, 60.0) is None


BAD = {
    "unsure of the place": {"sigma_p": 0.2},
    "unsure of the attitude": {"sigma_theta": 0.2},
    "no number": {"sigma_p": np.nan},
    "nowhere": {"p_bc_in_c": np.full(3, np.nan)},
    "behind": {"p_bc_in_c": np.array([-2.0, 0.0, 0.0])},
}


@pytest.mark.parametrize("change", BAD.values(), ids=BAD)
def test_an_expectation_that_knows_too_little_names_nothing(change):
    truth = truth_at(np.random.default_rng(115))
    assert places(CAMERA, LEDS_IN_B, replace(expected_of(truth), **change), CONFIG) is None


def test_an_led_expected_outside_the_picture_is_not_looked_for():
    truth = truth_at(np.random.default_rng(116))
    aside = replace(truth, p=truth.p + np.array([0.0, 1.6, 0.0]))
    where = places(CAMERA, LEDS_IN_B, expected_of(aside), CONFIG)
    inside = CAMERA.sees(aside.pixels())
    assert not inside.all()
    np.testing.assert_array_equal(where.reach_px > 0.0, inside)


def looked(eye, frame, truth, expected, sensors=True):
    """As the server does it: what is found is believed."""
    known = truth.prior() if sensors else FramePrior()
    detection = eye.step(frame, replace(known, expected=expected))
    if detection.pose is not None:
        eye.keep(detection.pose)
    return detection


@pytest.mark.parametrize("covered", [(0, 1, 2, 3), (1, 2, 4), (0, 3, 4)])
def test_vision_hands_on_the_rays_of_a_few(covered):
    rng = np.random.default_rng(120)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    looked(eye, frame_at(0.0, truth, rng), truth, None)
    seen, named_leds = sorted(set(range(len(LEDS_IN_B))) - set(covered)), 0
    for k in range(1, 31):
        truth = moved(truth, rng)
        expected = expected_of(truth, 0.01, rng=rng, t=k * DT)
        detection = looked(eye, frame_at(k * DT, truth, rng, covered=covered), truth, expected)
        assert detection.pose is None
        true = rays_at(k * DT, truth.p, truth.R, detection.rays.led)
        assert set(detection.rays.led.tolist()) <= set(seen)
        np.testing.assert_allclose(detection.rays.tangents, true.tangents, atol=3e-4)
        named_leds += len(detection.rays)
    assert named_leds >= 0.95 * 30 * len(seen)
    assert detection.reason == f"{len(seen)} of {len(LEDS_IN_B)} LEDs seen."
    told = detection.seen(CAMERA)
    assert told is not None
    assert told.half_field == CAMERA.half_field


def test_three_are_a_pose_for_a_while_after_four_were():
    rng = np.random.default_rng(127)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    looked(eye, frame_at(0.0, truth, rng), truth, None)
    poses = []
    for k in range(1, 31):
        truth = moved(truth, rng)
        detection = looked(eye, frame_at(k * DT, truth, rng, covered=(0, 4)), truth, None)
        assert detection.pose is None or not is_wrong(detection.pose, truth)
        poses.append(detection.pose is not None)
    assert all(poses[:3])
    assert not any(poses[-3:])


def test_without_an_expectation_a_few_are_nothing():
    rng = np.random.default_rng(121)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    looked(eye, frame_at(0.0, truth, rng), truth, None)
    detection = looked(eye, frame_at(DT, truth, rng, covered=(0, 1, 3)), truth, None)
    assert detection.reason == "2 of 5 LEDs seen: 4 are needed."
    assert detection.seen(CAMERA) is None


def test_who_comes_back_where_he_is_expected_is_seen_at_once_even_without_gravity():
    rng = np.random.default_rng(122)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    expected = expected_of(truth, 0.02, rng=rng)
    detection = looked(eye, frame_at(5.0, truth, rng, covered=(2,)), truth, expected, sensors=False)
    assert not is_wrong(detection.pose, truth)


def elsewhere(truth, expected_t=0.0):
    """A filter that has lost its way: sure of itself, 40 cm off."""
    return expected_of(replace(truth, p=truth.p + np.array([0.0, 0.4, 0.1])), t=expected_t)


def test_a_wrong_filter_is_contradicted_by_the_picture():
    rng = np.random.default_rng(123)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    for k in range(10):
        detection = looked(eye, frame_at(k * DT, truth, rng), truth, elsewhere(truth, k * DT))
        assert not is_wrong(detection.pose, truth)


def with_lamp(frame, place):
    luma = frame.luma.copy()
    u, v = np.round(place).astype(int)
    luma[v - 4 : v + 4, u - 4 : u + 4] = 255
    return Frame(frame.t, luma)


def test_a_wrong_filter_does_not_confirm_itself_by_a_lamp_for_ever():
    """The robot comes into sight while the filter follows a lamp: it is known at once."""
    rng = np.random.default_rng(124)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    lie = elsewhere(truth)
    lamp = CAMERA.pixels(lie.p_bc_in_c + LEDS_IN_B @ lie.R_cb.T)[1]
    found = []
    for k in range(40):
        covered = (0, 1, 2, 3, 4) if k < 3 else ()
        frame = with_lamp(frame_at(k * DT, truth, rng, covered=covered), lamp)
        found.append(looked(eye, frame, truth, replace(lie, t=k * DT)))
    assert len(found[1].rays) == 1  # deceived
    first = next(k for k, detection in enumerate(found) if detection.pose is not None)
    assert first == 3
    for detection in found[first:]:
        assert not is_wrong(detection.pose, truth)


def test_a_contradicted_filter_names_nothing_until_it_has_come_round():
    rng = np.random.default_rng(125)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    lie = elsewhere(truth)
    looked(eye, frame_at(0.0, truth, rng), truth, lie)
    lamp = CAMERA.pixels(lie.p_bc_in_c + LEDS_IN_B @ lie.R_cb.T)[1]
    dark = with_lamp(frame_at(DT, truth, rng, covered=(0, 1, 2, 3, 4)), lamp)
    assert len(looked(eye, dark, truth, replace(lie, t=DT)).rays) == 0
    looked(eye, frame_at(2 * DT, truth, rng), truth, expected_of(truth, t=2 * DT))
    few = frame_at(3 * DT, truth, rng, covered=(0, 1, 2))
    assert len(looked(eye, few, truth, expected_of(truth, t=3 * DT)).rays) == 2


def test_a_picture_full_of_lamps_costs_no_names():
    rng = np.random.default_rng(126)
    eye, truth = Vision(CAMERA, LEDS_IN_B), truth_at(rng)
    right = 0
    for k in range(6):
        truth = moved(truth, rng)
        luma = picture(truth, rng, RenderOptions(distractors=10), covered=(0, 3, 4))
        expected = expected_of(truth, 0.005, rng=rng, t=k * DT)
        detection = looked(eye, Frame(k * DT, luma), truth, expected)
        assert set(detection.rays.led.tolist()) <= {1, 2}
        right += len(detection.rays)
    assert right >= 6
