"""What one picture leaves open, later ones decide, or nothing is said."""

from dataclasses import replace

import numpy as np

from pipeline.frames import R_from_rpy, exp, log
from pipeline.identification.initialisation import CONFIRMED, Initialisation
from pipeline.identification.pnp import pose_of
from pipeline.identification.relocalisation import SearchHints
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, UP_IN_F, Truth, is_wrong, truth_at
from tests.pipeline.spotting import CONFIG, NOISE_PX, hints_of, lamps_beside, seen, spots_of

DT = 1.0 / 30.0
STILL = np.zeros((2, 3))


def starting(leds_in_b=LEDS_IN_B):
    return Initialisation(CAMERA, leds_in_b, CONFIG)


def turning(truth, k, rate=0.03):
    """The robot goes round by `rate` [rad] a picture, and the turns of c and b since the last."""
    about = truth.R.T @ truth.R_fc.T @ UP_IN_F
    return replace(truth, R=truth.R @ exp(k * rate * about)), np.stack((np.zeros(3), rate * about))


def test_a_sure_explanation_is_told_at_once():
    rng = np.random.default_rng(80)
    truth = truth_at(rng)
    association = starting().step(0.0, seen(truth, rng, lamps=5), hints_of(truth), None)
    assert not is_wrong(pose_of(association.fit, 0.0), truth)


def test_another_robot_in_other_spots_is_told_beside_the_first_one():
    rng = np.random.default_rng(87)
    for gravity in (True, False):
        truth = truth_at(rng)
        twin = replace(truth, p=truth.p + np.array([0.3, 0.9, 0.1]))
        both = np.vstack((truth.pixels(), twin.pixels()))
        pixels = np.vstack((both, lamps_beside(both, 4, rng)))
        eye, spots = starting(), spots_of(pixels + rng.normal(0.0, NOISE_PX, pixels.shape))
        first = eye.step(0.0, spots, hints_of(truth, gravity=gravity), None)
        (other,) = eye.others
        told = [pose_of(one.fit, 0.0) for one in (first, other)]
        assert sorted(is_wrong(pose, truth) for pose in told) == [False, True]
        assert sorted(is_wrong(pose, twin) for pose in told) == [False, True]
        assert not set(first.match.spot) & set(other.match.spot)


def test_lamps_are_no_other_robot():
    rng = np.random.default_rng(88)
    for lamps in (4, 12, 25):
        truth, eye = truth_at(rng), starting()
        assert eye.step(0.0, seen(truth, rng, lamps=lamps), hints_of(truth), None) is not None
        assert eye.others == []


def test_four_leds_without_gravity_wait_until_the_robot_has_turned():
    rng = np.random.default_rng(81)
    late = 0
    for _ in range(6):
        start, eye, found = truth_at(rng), starting(), None
        for k in range(12):
            truth, _ = turning(start, k)
            association = eye.step(k * DT, seen(truth, rng, range(4), lamps=0), SearchHints(), None)
            if association is not None:
                assert not is_wrong(pose_of(association.fit, 0.0), truth)
                found = k if found is None else found
        assert found is not None
        late += found >= CONFIRMED - 1
    assert late >= 4


def test_a_weak_explanation_that_never_moves_is_never_told():
    rng = np.random.default_rng(82)
    for _ in range(4):
        truth, eye = truth_at(rng), starting()
        lamps = lamps_beside(truth.pixels(), 3, rng)
        pixels = np.vstack((truth.pixels()[:4], lamps))
        told = 0
        for k in range(12):
            spots = spots_of(pixels + rng.normal(0.0, NOISE_PX, pixels.shape))
            told += eye.step(k * DT, spots, SearchHints(), None) is not None
        assert told == 0


def test_a_pause_ends_what_was_pending():
    rng = np.random.default_rng(83)
    start, eye = truth_at(rng), starting()
    for k in range(6):
        truth, _ = turning(start, k, 0.1)
        assert eye.step(5.0 * k, seen(truth, rng, range(4)), SearchHints(), None) is None


FLAT = np.column_stack((np.zeros(5), LEDS_IN_B[:, 1:]))
"""A robot whose LEDs are in one plane: seen from afar it has two attitudes that fit alike."""


def flat_view(yaw, distance, rng, noise_px=0.05):
    R_fc = np.eye(3)
    truth = Truth(distance * np.array([1.0, 0.02, 0.01]), R_from_rpy(np.array([0, 0, yaw])), R_fc)
    pixels = CAMERA.pixels(truth.p + FLAT @ truth.R.T)
    return truth, spots_of(pixels + rng.normal(0.0, noise_px, pixels.shape))


def upright(truth):
    return SearchHints(truth.R_fc.T @ UP_IN_F, truth.R.T @ truth.R_fc.T @ UP_IN_F)


def test_of_two_branches_none_is_told_while_both_fit():
    rng = np.random.default_rng(84)
    told = 0
    for _ in range(10):
        truth, spots = flat_view(0.25, 9.0, rng)
        eye = starting(FLAT)
        association = eye.step(0.0, spots, upright(truth), None)
        told += association is not None
        assert association is not None or eye.ambiguous
    assert told == 0


def test_the_gyroscopes_refute_the_wrong_branch():
    rng = np.random.default_rng(85)
    decided = 0
    for _ in range(8):
        eye, up = starting(FLAT), np.array([0.0, 0.0, 1.0])
        for k in range(12):
            truth, spots = flat_view(0.2 + 0.04 * k, 9.0, rng)
            turn = np.stack((np.zeros(3), 0.04 * up))
            association = eye.step(k * DT, spots, upright(truth), turn)
            if association is not None:
                assert np.linalg.norm(log(association.fit.R_cb.T @ truth.R)) < np.deg2rad(10.0)
                decided += 1
                break
    assert decided >= 6


def test_against_a_remembered_attitude_only_the_surest_is_told():
    rng = np.random.default_rng(86)
    truth = truth_at(rng)
    hints = replace(hints_of(truth), R_cb=truth.R.T, turn=0.3)
    assert starting().step(0.0, seen(truth, rng), hints, STILL) is not None
    four = seen(truth, rng, range(4), lamps=10)
    assert starting().step(0.0, four, hints, STILL) is None


def ball_of(count, rng):
    """(count, 3) LEDs about a robot, none near another."""
    leds = []
    while len(leds) < count:
        way = rng.normal(size=3)
        led = way * rng.uniform(0.25, 0.35) / np.linalg.norm(way)
        if all(np.linalg.norm(led - other) > 0.07 for other in leds):
            leds.append(led)
    return np.array(leds)


def test_of_thirty_two_leds_the_near_half_is_enough_without_gravity():
    for seed in (0, 1):
        rng = np.random.default_rng(seed)
        leds_in_b, truth = ball_of(32, rng), truth_at(rng)
        leds_in_c = truth.p + leds_in_b @ truth.R.T
        near = np.flatnonzero(leds_in_c[:, 0] <= np.median(leds_in_c[:, 0]))
        shown, eye, association, k = CAMERA.pixels(leds_in_c), starting(leds_in_b), None, 0
        while association is None and k < 60:
            pixels = np.vstack((shown[near], lamps_beside(shown, 3, rng)))
            pixels += rng.normal(0.0, NOISE_PX, pixels.shape)
            spots = spots_of(pixels, brightness=rng.uniform(1.0, 2.0, len(pixels)))
            association, k = eye.step(k * DT, spots, SearchHints(), None), k + 1
        assert not is_wrong(pose_of(association.fit, 0.0), truth)
        assert set(association.match.led) == set(near)


def test_all_of_thirty_two_leds_are_named():
    rng = np.random.default_rng(2)
    leds_in_b, truth = ball_of(32, rng), truth_at(rng)
    pixels = CAMERA.pixels(truth.p + leds_in_b @ truth.R.T)
    apart = np.linalg.norm(pixels[:, None] - pixels, axis=2) + np.eye(32) * 99.0
    assert apart.min() > 1.0
    association = starting(leds_in_b).step(0.0, spots_of(pixels), hints_of(truth), None)
    assert len(association.match.led) == 32
    assert not is_wrong(pose_of(association.fit, 0.0), truth)
