"""A code while the robot is not found, and only if it can be told; light while it is tracked."""

from dataclasses import replace

import numpy as np

from pipeline.signals import LedRays, RelativePose, Spots
from pipeline.vision.blink_code import CODES
from pipeline.vision.detection import Detection, FramePrior
from pipeline.vision.rays import NO_RAYS
from server.phone.blink_choice import KEPT_S, LEAD_S, SAID_S, UNSEEN_S, BlinkChoice

NONE = Spots(np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))
UP, STILL = np.array([0.0, 0.0, 1.0]), np.zeros(3)
MISSED = Detection(0.0, None, NO_RAYS, NONE, None, "", prior=FramePrior(UP, UP, STILL, STILL))
POSE = RelativePose(0.0, np.array([2.5, 0.0, 0.0]), np.eye(3), 1e-6 * np.eye(6), 0.1, 5)
FOUND = replace(MISSED, pose=POSE)
FEW = replace(
    MISSED, rays=LedRays(np.zeros(1, np.intp), np.zeros(1), np.zeros((1, 2)), np.eye(2)[None])
)
DT = 1.0 / 30.0


def test_it_is_told_while_the_robot_is_not_found_and_told_again():
    choice, told = BlinkChoice(), []
    for k in range(30):
        wish = choice.look(MISSED, 5.0 + k * DT)
        assert choice.code is not None
        if wish is not None:
            told.append((k * DT, wish))
    assert {(wish.number, wish.t_begin) for _, wish in told} == {
        (choice.code.number, choice.code.t_begin)
    }
    assert choice.code.t_begin == 5.0 + LEAD_S
    assert max(np.diff([t for t, _ in told])) <= SAID_S + DT + 1e-9


def test_nothing_blinks_while_the_robot_is_found_or_for_a_short_miss():
    for seen in (FOUND, FEW):
        choice = BlinkChoice()
        choice.look(MISSED, 0.0)
        for k in range(1, 60):
            detection = MISSED if k % 8 == 7 else seen
            assert choice.look(detection, k * DT) is None
            assert choice.code is None


def test_a_longer_miss_begins_a_new_code():
    choice = BlinkChoice()
    choice.look(FOUND, 0.0)
    assert choice.look(MISSED, UNSEEN_S - 0.01) is None
    wish = choice.look(MISSED, UNSEEN_S + 0.01)
    assert wish is not None
    assert wish.t_begin > UNSEEN_S


def test_while_nothing_is_heard_of_the_robot_or_phone_nothing_is_awaited():
    deaf = FramePrior(UP, None, STILL, None), FramePrior(None, UP, None, STILL), FramePrior()
    for prior in deaf:
        choice = BlinkChoice()
        assert choice.look(replace(MISSED, prior=prior), 0.0) is None
        assert choice.code is None


def test_who_stays_unfound_is_given_other_codes_by_and_by():
    choice, numbers, begins = BlinkChoice(), set(), set()
    for k in range(round(40 * KEPT_S / DT)):
        choice.look(MISSED, 0.123456 + k * 0.0333333)
        numbers.add(choice.code.number)
        begins.add(choice.code.t_begin)
    assert len(begins) >= 38
    assert len(numbers) > CODES / 2


def test_one_that_cannot_say_which_way_is_up_is_told_as_well():
    """An arm's tip without motion sensors: who it is shows nowhere but in its code."""
    prior = FramePrior(UP, None, STILL, STILL)
    assert BlinkChoice().look(replace(MISSED, prior=prior), 0.0) is not None
