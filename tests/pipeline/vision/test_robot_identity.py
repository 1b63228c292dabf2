"""Which of two robots of one kind is ours: by motion or by place, else nobody is told."""

import numpy as np
import pytest

from hardware.sim.scenes.motion import START_S
from hardware.sim.scenes.video import RATE_HZ
from pipeline.signals import RelativePose, VisionMeasurement
from pipeline.vision.blink_code import BlinkCode
from pipeline.vision.last_pose import PossiblePlace
from pipeline.vision.motion_hypotheses import CandidateView
from pipeline.vision.robot_identity import (
    ELSEWHERE,
    READING,
    REMEMBERED_S,
    TWO,
    RobotIdentity,
)
from tests.pipeline.seeing import rays_at
from tests.pipeline.twins import BOTH, LEDS_IN_B, Twins

OURS, OTHER = (True, False), (False, True)
SEEDS = range(2)
NOISY_REST = 1017
"""Of these gyroscopes' noise the first pictures make motion that comes 12 ms late."""


def first_told(twins, pictures, **how):
    """Number of the first picture that tells a robot, and whether it is ours."""
    for k in range(pictures):
        told = twins.look(k, **how)
        if told.is_ours is not None:
            return k, told.is_ours
        assert told.reason in (TWO, ELSEWHERE, READING)
    return None


@pytest.mark.parametrize("resting", [(False, False), (True, False), (False, True)])
def test_whoever_moves_the_motion_of_ours_tells_it(resting):
    for seed in SEEDS:
        k, is_ours = first_told(Twins(seed, resting), 60)
        assert is_ours
        assert k >= 3


def test_while_both_rest_nobody_is_told():
    for seed in (*SEEDS, NOISY_REST):
        twins = Twins(seed, (True, True))
        for k in range(40):
            told = twins.look(k)
            assert (told.looks, told.is_ours, told.reason) == (2, None, TWO)


def test_without_motion_sensors_nobody_is_told():
    assert first_told(Twins(0, imus=False), 40) is None


def test_who_stands_where_ours_must_be_is_ours_at_once():
    for seed in SEEDS:
        twins = Twins(seed, (True, True))
        reach = [PossiblePlace(twins.place(START_S), 0.3)]
        assert twins.look(0, reach=reach).is_ours


def test_a_robot_where_ours_cannot_be_is_not_ours_however_long_it_is_seen():
    for seed in SEEDS:
        twins = Twins(seed, (True, True))
        for k in range(60):
            reach = [PossiblePlace(twins.place(START_S + k / RATE_HZ), 0.3 + 0.03 * k)]
            told = twins.look(k, OTHER, reach)
            assert (told.is_ours, told.reason) == (None, ELSEWHERE)


def test_ours_is_believed_elsewhere_once_it_moved_as_it_felt():
    for seed in SEEDS:
        wrong = [PossiblePlace(np.array([4.0, 2.0, 0.0]), 0.3)]
        k, is_ours = first_told(Twins(seed), 60, shine=OURS, reach=wrong)
        assert is_ours
        assert k >= 3


def test_the_other_one_alone_is_remembered_and_not_taken_for_ours():
    for seed in SEEDS:
        twins = Twins(seed, (True, True))
        twins.look(0, BOTH)
        for k in range(1, 40):
            assert twins.look(k, OTHER).is_ours is None
        late = 40 + round((REMEMBERED_S + 1.0) * RATE_HZ)
        assert twins.look(late, OURS).is_ours


CODE = BlinkCode(3, 0.0)


@pytest.mark.parametrize("other", [None, BlinkCode(9, 0.21), BlinkCode(3, 0.25)])
def test_who_blinks_as_it_was_told_is_ours_even_at_rest(other):
    for seed in SEEDS:
        twins = Twins(seed, (True, True), code=CODE)
        k, is_ours = first_told(twins, 30, codes=(CODE, other))
        assert is_ours
        assert k <= 15


def test_a_robot_alone_that_shines_or_blinks_otherwise_is_not_taken_for_ours():
    for seed, other in enumerate((None, BlinkCode(9, 0.21))):
        twins = Twins(seed, (True, True), code=CODE)
        for k in range(60):
            told = twins.look(k, OTHER, codes=(CODE, other))
            assert told.is_ours is None
            assert told.reason in ("", READING)


def test_of_two_robots_that_blink_alike_nobody_is_told():
    twins = Twins(0, (True, True), code=CODE)
    assert first_told(twins, 45, codes=(CODE, CODE)) is None


def test_motion_tells_a_robot_whose_code_is_not_seen():
    for seed in SEEDS:
        twins = Twins(seed, code=CODE)
        _, is_ours = first_told(twins, 60)
        assert is_ours


@pytest.mark.parametrize("resting", [(True, False), (True, True)])
def test_of_robots_that_blink_who_is_none_of_the_others_is_not_ours_for_that(resting):
    """Ours is dark, a second one is none of ours, and then comes a third one."""
    for seed in SEEDS:
        twins = Twins(seed, resting, code=CODE, strangers=[0.9])
        for k in range(60):
            assert twins.look(k, (False, True, k >= 20)).is_ours is None


def test_who_comes_last_is_held_against_the_motion_sensors_as_the_others_were():
    """Ours is dark and two others are none of ours, and then comes a third one."""
    for seed in SEEDS:
        twins = Twins(seed, strangers=[0.8, 1.6])
        for k in range(60):
            assert twins.look(k, (False, True, True, k >= 20)).is_ours is None


def test_two_that_stand_closer_together_than_one_may_go_between_pictures_are_held_apart():
    """Each was taken for whichever of them had been seen first."""
    identity = RobotIdentity(LEDS_IN_B, None, blinks=True)
    identity.code, n = CODE, len(LEDS_IN_B)
    ours, beside = np.array([2.5, 0.0, 0.0]), np.array([0.0, 0.25, 0.0])
    told = []
    for k in range(30):
        t = k / RATE_HZ
        lit = [led for led in range(n) if led != CODE.dark(t, n)]
        views = [view_of(t, ours + beside, range(n)), view_of(t, ours, lit)]
        told.append(identity.which(t, views, (), None))
    assert set(told) == {None, 1}


def view_of(t, p, leds):
    rays, R = rays_at(t, p, np.eye(3), list(leds)), np.eye(3)
    pose = RelativePose(t, p, R, 1e-6 * np.eye(6), 0.1, len(rays))
    return CandidateView(VisionMeasurement(t, rays, pose), pose)
