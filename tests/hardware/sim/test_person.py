"""People who align the laser: how they err, wait, learn and move."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from hardware.sim.person import SPEED_M_S, GuidingHand, Participant, misalignment, remedy
from hardware.sim.plant.laser_task import Laser, Tube
from pipeline.frames import UP, exp

H = 0.005
LASER = Laser(np.array([0.0, 0.0, -0.2]), -UP)
AXIS = exp(np.array([radians(15.0), 0.0, 0.0])) @ UP
TUBE = Tube(-0.5 * AXIS, AXIS, 0.2, 0.015)
HAND = np.eye(3), np.array([-2.5, 0.0, 0.0])
PERSON = Participant("", 0.25, 1.0, 0.1, 3e-4, 3e-3, 0.004, 5e-5, 3e-4, 0.2, 0.2)
STEADY = replace(PERSON, acuity_rad=0.0, effort_noise=0.0)


def turned(roll: float, pitch: float = 0.0) -> np.ndarray:
    return exp(np.array([roll, pitch, 0.0]))


def test_who_is_aligned_sees_nothing_to_do() -> None:
    aligned = turned(radians(15.0)), np.zeros(3)
    assert misalignment(LASER, TUBE, aligned) == pytest.approx(np.zeros(6), abs=1e-12)
    along = aligned[0], 0.05 * AXIS
    assert misalignment(LASER, TUBE, along) == pytest.approx(np.zeros(6), abs=1e-12)


def test_shift_and_turn_bring_the_beam_onto_the_axis() -> None:
    body = turned(radians(13.0), radians(-2.0)), np.array([0.01, -0.02, 0.005])
    todo = remedy(misalignment(LASER, TUBE, body), TUBE.centre_in_f - body[1], AXIS)
    assert todo[2] == pytest.approx(0.0, abs=1e-12)
    there = exp(todo[3:]) @ body[0], body[1] + todo[:3]
    left = misalignment(LASER, TUBE, there)
    assert np.linalg.norm(left[:3]) < 1e-3
    assert np.linalg.norm(left[3:]) < 0.01 * np.linalg.norm(todo[3:])
    assert TUBE.clearance(LASER.beam(*there)) >= 0.0


def guided(person: Participant, seconds: float, seed: int = 0) -> tuple[GuidingHand, list[float]]:
    """A robot that is where the hand wants it at once; clearance of its beam each period [m]."""
    hand = GuidingHand(person, LASER, TUBE, np.random.default_rng(seed), H)
    clearances = []
    for k in range(round(seconds / H)):
        x = hand.at(k * H)[0]
        R_fc, p_cf_in_f = exp(x[3:]), HAND[1] + x[:3]
        body = R_fc, p_cf_in_f + R_fc @ -HAND[1] + (0.02, 0.03, 0.0)
        clearances.append(TUBE.clearance(LASER.beam(*body)))
        hand.look(body, (R_fc, p_cf_in_f))
    return hand, clearances


def test_a_robot_that_obeys_at_once_is_aligned_within_ten_seconds_and_stays() -> None:
    _, clearances = guided(STEADY, 15.0)
    assert clearances[0] < 0.0
    assert min(clearances[round(10.0 / H) :]) > 0.0


def test_the_hand_rests_for_the_delay_then_moves() -> None:
    hand, _ = guided(STEADY, 1.0)
    assert np.abs(hand.at(0.245)).max() == 0.0
    assert np.linalg.norm(hand.at(0.35)[0]) > 0.0


def test_rates_are_the_derivatives_and_nothing_jumps() -> None:
    hand, _ = guided(PERSON, 2.0)
    for t in np.arange(1.1, 1.9, 0.0137):
        rows, e = hand.at(t), 1e-5
        before, after = hand.at(t - e), hand.at(t + e)
        assert (after[0] - before[0]) / (2.0 * e) == pytest.approx(rows[1], abs=1e-6)
        assert (after[1] - before[1]) / (2.0 * e) == pytest.approx(rows[2], abs=1e-3)


def test_no_hand_hurries() -> None:
    hand, _ = guided(STEADY, 3.0)
    speeds = [np.linalg.norm(hand.at(t)[1, [0, 1]]) for t in np.arange(2.1, 3.0, 0.01)]
    assert max(speeds) <= 1.001 * SPEED_M_S


def test_the_same_seed_guides_the_same_and_another_does_not() -> None:
    first, again, other = (guided(PERSON, 1.0, seed)[0].at(0.9) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_depth_is_seen_worst_and_worse_from_afar_and_from_the_side() -> None:
    near, far, flat = (
        PERSON.sight_noise(np.array(p), 0.2)
        for p in ([1.2, 0.0, -0.5], [2.4, 0.0, -1.0], [2.4, 0.0, -0.5])
    )
    assert far == pytest.approx(near * [2.0, 2.0, 2.0, 1.0, 2.0, 1.0])
    assert flat[0] > 1.7 * far[0]
    assert flat[0] > 4.0 * flat[1]


def test_practice_quickens_and_steadies_but_not_below_the_nerves() -> None:
    tenth = PERSON.practised(10)
    assert PERSON.practised(1) == PERSON
    assert 0.1 < tenth.delay_s < PERSON.delay_s
    assert tenth.wander_m == pytest.approx(10.0**-0.2 * PERSON.wander_m)
    assert tenth.effort_noise < PERSON.effort_noise
    assert tenth.crossover == PERSON.crossover
    assert PERSON.practised(10**9).delay_s > 0.1
