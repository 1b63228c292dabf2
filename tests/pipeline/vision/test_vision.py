import sys
from dataclasses import replace

import numpy as np
import pytest

from hardware.codec import Decoder, Encoder
from hardware.sim.render import RenderOptions
from pipeline.frames import R_from_rpy
from pipeline.signals import Frame
from pipeline.vision.detection import FramePrior
from pipeline.vision.gating import gate_rejection
from pipeline.vision.last_pose import FOLLOWED, FORGET_MISSES, REACHED_S
from pipeline.vision.robot_identity import ELSEWHERE
from pipeline.vision.vision import Vision, warm_up
from pipeline.vision_config import GatesConfig
from tests.pipeline.seeing import (
    CAMERA,
    LEDS_IN_B,
    error_of,
    frame_at,
    is_wrong,
    moved,
    nees,
    truth_at,
)

DT = 1.0 / 30.0
DARK = np.full((CAMERA.height, CAMERA.width), 30, dtype=np.uint8)


def vision():
    return Vision(CAMERA, LEDS_IN_B)


def follow(eye, truths, rng, start=0, covered=(), prior=None):
    sightings = []
    for k, truth in enumerate(truths):
        frame = frame_at((start + k) * DT, truth, rng, covered=covered)
        detection = eye.step(frame, truth.prior() if prior is None else prior)
        if detection.pose is not None:
            eye.keep(detection.pose)
        sightings.append(detection)
    return sightings


def walk(rng, n, **motion):
    truths = [truth_at(rng)]
    while len(truths) < n:
        truths.append(moved(truths[-1], rng, **motion))
    return truths


def test_the_first_picture_gives_the_pose():
    rng = np.random.default_rng(50)
    truth = truth_at(rng)
    (detection,) = follow(vision(), [truth], rng)
    error = np.abs(error_of(detection.pose, truth))
    assert (error < [0.002, 0.0005, 0.0005, 0.003, 0.003, 0.003]).all()
    assert detection.reason == ""
    assert detection.pose.leds == 5


def test_tracking_follows_motion():
    rng = np.random.default_rng(51)
    truths = walk(rng, 15, dp=0.015, turn=0.01)
    for detection, truth in zip(follow(vision(), truths, rng), truths, strict=True):
        assert not is_wrong(detection.pose, truth)


def test_tracking_survives_a_covered_led():
    rng = np.random.default_rng(52)
    truths = walk(rng, 6)
    eye = vision()
    follow(eye, truths[:2], rng)
    for detection, truth in zip(
        follow(eye, truths[2:], rng, start=2, covered=(1,), prior=FramePrior()),
        truths[2:],
        strict=True,
    ):
        assert not is_wrong(detection.pose, truth)
        assert detection.pose.leds == 4


@pytest.mark.parametrize(("misses", "found"), [(FORGET_MISSES - 1, True), (15, False)])
def test_a_few_misses_and_it_is_forgotten(misses, found):
    """Without sensors four LEDs can be followed, but not found by one picture."""
    rng = np.random.default_rng(53)
    truth = truth_at(rng)
    eye = vision()
    follow(eye, [truth], rng)
    for k in range(misses):
        assert eye.step(Frame((1 + k) * DT, DARK), FramePrior()).pose is None
    (detection,) = follow(eye, [truth], rng, start=1 + misses, covered=(2,), prior=FramePrior())
    assert (detection.pose is not None) == found


def test_who_comes_back_is_known_by_the_attitude_that_the_gyroscopes_kept():
    """A second in the dark: four LEDs among lamps, elsewhere in the picture, without gravity."""
    rng = np.random.default_rng(66)
    truth = truth_at(rng)
    eye, still = vision(), np.zeros(3)
    sensors = FramePrior(None, None, still, still)
    follow(eye, [truth] * FOLLOWED, rng)
    for k in range(30):
        assert eye.step(Frame((FOLLOWED + k) * DT, DARK), sensors).pose is None
    back = replace(truth, p=truth.p + np.array([0.1, 0.3, -0.1]))
    (detection,) = follow(eye, [back], rng, start=FOLLOWED + 30, covered=(2,), prior=sensors)
    assert not is_wrong(detection.pose, back)


def test_what_looked_like_the_robot_in_one_picture_hides_it_no_longer_than_some_pictures():
    """Lamps, once: then the robot, turned otherwise, among as many lamps as a room may have."""
    rng = np.random.default_rng(60)
    eye, looked_like = vision(), truth_at(rng)
    follow(eye, [looked_like], rng)
    robot = replace(looked_like, R=looked_like.R @ R_from_rpy(np.array([0.0, 0.0, 1.2])))
    lamps = rng.uniform((40.0, 40.0), (CAMERA.width - 40.0, CAMERA.height - 40.0), (40, 2))
    for k in range(1, 16):
        frame = frame_at(k * DT, robot, rng)
        for x, y in lamps.astype(int):
            frame.luma[y - 2 : y + 3, x - 2 : x + 3] = 255
        detection = eye.step(frame, robot.prior())
        if detection.pose is not None:
            break
    assert k < 10
    assert not is_wrong(detection.pose, robot)


def test_forgetting_is_immediate():
    rng = np.random.default_rng(54)
    truth = truth_at(rng)
    eye = vision()
    follow(eye, [truth], rng)
    eye.forget()
    (detection,) = follow(eye, [truth], rng, start=1, covered=(2,), prior=FramePrior())
    assert detection.pose is None


@pytest.mark.parametrize("t", [-1.0, 0.0, 100.0])
def test_a_picture_from_another_time_is_searched_from_nothing(t):
    rng = np.random.default_rng(55)
    eye = vision()
    follow(eye, [truth_at(rng)], rng)
    elsewhere = truth_at(rng, 3.5)
    detection = eye.step(frame_at(t, elsewhere, rng), elsewhere.prior())
    assert not is_wrong(detection.pose, elsewhere)


def test_who_could_not_have_jumped_so_far_is_not_believed_until_ours_may_be_anywhere():
    rng = np.random.default_rng(56)
    eye, here, there = vision(), truth_at(rng), truth_at(rng, 3.2)
    follow(eye, [here], rng)
    for detection in follow(eye, [there] * 3, rng, start=1):
        assert detection.pose is None
        assert detection.reason == ELSEWHERE
    later = round((REACHED_S + 1.0) / DT)
    for k in range(4, later, 12):
        eye.step(Frame(k * DT, DARK), there.prior())
    (detection,) = follow(eye, [there], rng, start=later)
    assert not is_wrong(detection.pose, there)


def test_an_led_outside_the_picture_does_no_harm():
    rng = np.random.default_rng(57)
    truth = truth_at(rng)
    while CAMERA.sees(truth.pixels()).sum() > 4:
        truth = replace(truth, p=truth.p + np.array([0.0, 0.01, 0.0]))
    for detection in follow(vision(), [truth] * 4, rng):
        assert not is_wrong(detection.pose, truth)
        assert detection.pose.leds == 4


REASONS = {
    (0, 1, 2, 3, 4): "No light in the picture is bright enough.",
    (0, 1, 2): "2 of 5 LEDs seen: 4 are needed.",
    (3, 4): "3 of 5 LEDs seen: 4 are needed.",
}


@pytest.mark.parametrize(("covered", "reason"), REASONS.items())
def test_too_few_leds_are_counted_in_the_reason(covered, reason):
    rng = np.random.default_rng(58)
    (detection,) = follow(vision(), [truth_at(rng)], rng, covered=covered)
    assert detection.pose is None
    assert detection.match is None
    assert detection.reason == reason


def test_lights_that_are_no_robot_are_called_so():
    rng = np.random.default_rng(59)
    truth = truth_at(rng)
    frame = frame_at(0.0, truth, rng)
    mirrored = Frame(0.0, frame.luma[:, ::-1])
    detection = vision().step(mirrored, FramePrior())
    assert detection.pose is None
    assert detection.reason == "5 lights seen, but they do not look like the robot."


def turned(truth, quarter_turns):
    """What a picture turned in its plane looks like: the sensors know nothing of it."""
    R = R_from_rpy(np.array([0.5 * np.pi * quarter_turns, 0.0, 0.0]))
    return replace(truth, p=R @ truth.p, R=R @ truth.R)


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_a_turned_picture_is_refused(quarter_turns):
    rng = np.random.default_rng(60)
    for _ in range(3):
        truth = truth_at(rng)
        prior = truth.prior()
        frame = frame_at(0.0, turned(truth, quarter_turns), rng)
        assert_refused(frame, prior)


def test_a_mirrored_picture_is_refused():
    rng = np.random.default_rng(61)
    for _ in range(4):
        truth = truth_at(rng)
        frame = frame_at(0.0, truth, rng)
        assert_refused(Frame(0.0, frame.luma[:, ::-1]), truth.prior())


def assert_refused(frame, prior):
    pose = vision().step(frame, prior).pose
    assert (
        pose is None
        or gate_rejection(pose, prior.up_in_c, prior.up_in_b, GatesConfig()) is not None
    )


def test_the_same_pictures_give_the_same_bits():
    def run():
        rng = np.random.default_rng(62)
        return [s.pose for s in follow(vision(), walk(rng, 5), rng)]

    for one, other in zip(run(), run(), strict=True):
        assert np.array_equal(one.p_bc_in_c, other.p_bc_in_c)
        assert np.array_equal(one.R_cb, other.R_cb)
        assert np.array_equal(one.covariance, other.covariance)


def test_the_claimed_covariance_is_honest_on_video():
    rng = np.random.default_rng(63)
    encoder = Encoder(CAMERA.width, CAMERA.height, 30.0, 3_000_000)
    decoder = Decoder("h264", CAMERA.width, CAMERA.height)
    eye, scores = vision(), []
    for k, truth in enumerate(walk(rng, 40)):
        data, _ = encoder.encode(frame_at(0.0, truth, rng).luma)
        detection = eye.step(Frame(k * DT, decoder.decode(data), False), truth.prior())
        eye.keep(detection.pose)
        scores.append(nees(detection.pose, truth))
    assert 0.2 < np.median(scores) < 2.0


def test_the_stages_are_timed_by_the_clock_that_is_given():
    rng = np.random.default_rng(64)
    ticks = iter(range(100))
    truth = truth_at(rng)
    detection = vision().step(frame_at(0.0, truth, rng), truth.prior(), lambda: next(ticks))
    assert detection.took_s == {"detect": 1, "identify": 1, "pose": 1}


def compiled():
    """How often everything in the pipeline that can be compiled was."""
    return {
        f"{name}.{key}": len(value.signatures)
        for name, module in list(sys.modules.items())
        if name.startswith("pipeline")
        for key, value in vars(module).items()
        if hasattr(value, "signatures") and hasattr(value, "py_func")
    }


def test_after_warming_up_nothing_is_left_to_compile():
    warm_up()
    before = compiled()
    rng = np.random.default_rng(65)
    for prior in (None, FramePrior()):
        truth = truth_at(rng)
        for covered in ((), (1,), (1, 2, 3, 4), ()):
            eye = vision()
            for k in range(3):
                frame = frame_at(k * DT, truth, rng, RenderOptions(distractors=4), covered)
                frame.luma.setflags(write=False)
                detection = eye.step(frame, truth.prior() if prior is None else prior)
                if detection.pose is not None:
                    eye.keep(detection.pose)
    assert detection.pose is not None
    assert compiled() == before


def test_lamps_by_the_dozen_are_said_to_be_more_than_could_be_tried():
    rng = np.random.default_rng(67)
    truth = truth_at(rng)
    detection = vision().step(
        frame_at(0.0, truth, rng, RenderOptions(distractors=60)), FramePrior()
    )
    assert detection.pose is None or not is_wrong(detection.pose, truth)
    assert detection.bounded
    assert not vision().step(frame_at(0.0, truth, rng), FramePrior()).bounded
