"""Who wrote the LEDs of a robot file wrongly is told what is wrong with them."""

import numpy as np
import pytest

from pipeline.identification.relocalisation import SearchHints
from pipeline.spots.leds import find_spots
from pipeline.vision.misplaced_leds import (
    ELSEWHERE,
    LOOK_S,
    MIRROR,
    MIRRORED,
    SHOWN,
    MisplacedLeds,
)
from pipeline.vision.vision import LONG_IN_VAIN, Vision
from pipeline.vision_config import IdentifyConfig, LedsConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, frame_at, moved, truth_at

DT = 1.0 / 30.0
PICTURES = LONG_IN_VAIN + int((SHOWN + 0.5) * LOOK_S / DT)
NO_ROBOT = "lights seen, but they do not look like the robot."


def seen(eye, shown, truth, rng, t, covered=()):
    """Why no robot is found in a picture of LEDs at `shown`; "" if one is."""
    detection = eye.step(frame_at(t, truth, rng, covered=covered, leds=shown), truth.prior())
    if detection.pose is not None:
        eye.keep(detection.pose)
    return detection.reason


def reasons(leds_in_b, seed, pictures=PICTURES, shown=LEDS_IN_B, covered=()):
    """Of each picture of a robot whose LEDs are where they are `shown`, not where its file says."""
    rng = np.random.default_rng(seed)
    eye, truth = Vision(CAMERA, leds_in_b), truth_at(rng)
    for k in range(pictures):
        yield seen(eye, shown, truth, rng, k * DT, covered)
        truth = moved(truth, rng, dp=0.003, turn=0.003)


def measured(seed, off_mm):
    """LEDs as a file has them that is off by so much [mm], one axis, RMS."""
    off = np.random.default_rng((seed, 5)).standard_normal(LEDS_IN_B.shape)
    return LEDS_IN_B + 1e-3 * off_mm * off / np.sqrt(np.square(off).mean())


@pytest.mark.parametrize(("off_mm", "least"), [(6.0, 1), (12.0, 4)])
def test_leds_that_were_measured_badly_are_told_with_by_how_much(off_mm, least):
    """Unless the robot is found all the same."""
    begin, end = ELSEWHERE.format(lights=5, mm="|").split("|")
    told = []
    for seed in range(1, 7):
        said = list(reasons(measured(seed, off_mm), seed))
        if "" not in said:
            assert said[-1].startswith(begin)
            told.append(float(said[-1].removeprefix(begin).removesuffix(end)))
    assert len(told) >= least
    assert all(0.5 * off_mm < mm < 1.5 * off_mm for mm in told)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_file_with_left_for_right_is_told_so(seed):
    *_, last = reasons(LEDS_IN_B * MIRROR, seed)
    assert last == MIRRORED.format(lights=5)


def test_it_is_searched_in_vain_for_a_while_before_anything_is_said():
    said = list(reasons(measured(1, 12.0), 1))
    looks_s = (SHOWN - 1) * LOOK_S
    first = next(k for k, reason in enumerate(said) if "elsewhere" in reason)
    assert LONG_IN_VAIN + looks_s / DT - 1 <= first <= LONG_IN_VAIN + looks_s / DT + 2
    assert set(said[:first]) == {f"5 {NO_ROBOT}"}


@pytest.mark.parametrize("lamps", [6, 9, 12])
def test_lamps_are_no_robot_that_was_measured_badly(lamps):
    for seed in range(6):
        places = np.random.default_rng((seed, 9)).uniform(-0.35, 0.35, (lamps, 3))
        said = set(reasons(LEDS_IN_B, seed, 2 * PICTURES, shown=places))
        assert not any("robot's" in reason for reason in said)


def test_of_a_robot_with_a_hidden_led_nothing_is_said():
    for seed in range(1, 7):
        said = set(reasons(measured(seed, 12.0), seed, covered=(1,)))
        assert not any("robot's" in reason for reason in said)


@pytest.mark.parametrize(("off_mm", "is_said"), [(0.0, False), (12.0, True)])
def test_leds_that_are_where_the_file_says_are_not_said_to_be_elsewhere(off_mm, is_said):
    """Whatever keeps them from being found: something did, or nobody would look here."""
    rng = np.random.default_rng(1)
    truth, config = truth_at(rng), LedsConfig()
    misplaced = MisplacedLeds(CAMERA, measured(1, off_mm), IdentifyConfig())
    hints = SearchHints(truth.prior().up_in_c, truth.prior().up_in_b)
    for k in range(SHOWN):
        misplaced.look(k * LOOK_S, find_spots(frame_at(0.0, truth, rng), config), hints)
    assert ("elsewhere" in misplaced.reason) == is_said


def test_what_is_not_seen_look_after_look_is_not_said():
    rng = np.random.default_rng(1)
    eye, truth = Vision(CAMERA, measured(1, 12.0)), truth_at(rng)
    lamps = rng.uniform(-0.35, 0.35, (5, 3))
    for k in range(3 * PICTURES):
        shown = lamps if round(k * DT / LOOK_S) % 2 else LEDS_IN_B
        assert "robot's" not in seen(eye, shown, truth, rng, k * DT)


def test_it_is_said_no_more_of_another_thing():
    rng = np.random.default_rng(1)
    eye, truth = Vision(CAMERA, measured(1, 12.0)), truth_at(rng)
    lamps = rng.uniform(-0.35, 0.35, (5, 3))
    for k in range(2 * PICTURES):
        said = seen(eye, LEDS_IN_B if k < PICTURES else lamps, truth, rng, k * DT)
        assert k != PICTURES - 1 or "elsewhere" in said
    assert said == f"5 {NO_ROBOT}"


def test_of_a_robot_that_was_found_nothing_is_said_again_at_once():
    rng, file = np.random.default_rng(1), measured(1, 12.0)
    eye, truth, lamps = Vision(CAMERA, file), truth_at(rng), rng.uniform(-0.35, 0.35, (5, 3))
    shown = [LEDS_IN_B] * PICTURES + [file] + [lamps] * LONG_IN_VAIN + [LEDS_IN_B]
    said = [seen(eye, leds, truth, rng, k * DT) for k, leds in enumerate(shown)]
    assert "elsewhere" in said[PICTURES - 1]
    assert said[PICTURES] == ""
    assert said[PICTURES + 1] == f"5 {NO_ROBOT}"
    assert "elsewhere" not in said[-1]
