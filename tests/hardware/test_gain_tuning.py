"""Tuned gains keep the margins that were asked for, and hold the robot better than ours."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians

import numpy as np
import pytest

from hardware.gain_check import loop_of
from hardware.gain_tuning import TuningError, margins_of, moved, tuned, with_gains
from hardware.robot_file import load_robot
from pipeline.control.margins import OMEGA, Loop, S, Sensing, axis_margins
from pipeline.control.robust_margins import MarginGoals, is_robust, worst_margins
from pipeline.gains import Gains

GOALS = MarginGoals(delay=0.010)
X, ROLL, YAW = 0, 3, 5


def loop(robot: str, gains: str = "phone") -> Loop:
    robot_file = load_robot(robot)
    return loop_of(robot_file, robot_file.gains[gains])


def keeps(one: Loop, axis: int, sensing: Sensing) -> bool:
    return not GOALS.lacking(margins_of(one, axis, sensing))


BY_HAND = replace(
    loop("ames"),
    gains=Gains(
        Kp=np.array([80.0, 80.0, 120.0, 4.0, 4.0, 4.0]),
        Ki=np.array([90.0, 90.0, 150.0, 8.0, 8.0, 8.0]),
        Kd=np.array([30.0, 30.0, 30.0, 0.9, 0.9, 1.4]),
    ),
)
"""The AMES's for phones, before its attitude was controlled ahead of its thrusters."""


@cache
def best(robot: str, axis: int, latency: float) -> Loop:
    start = loop(robot)
    return replace(start, gains=tuned(start, [axis], Sensing("relative", latency), GOALS))


@pytest.mark.slow
@pytest.mark.parametrize("axis", [X, YAW])
def test_it_keeps_the_margins_of_all_bodies_and_rejects_better_than_gains_by_hand_that_do(axis):
    sensing, found = Sensing("relative", 0.09), best("ames", axis, 0.09)
    assert keeps(found, axis, sensing)
    assert is_robust(worst_margins(found, axis, sensing))
    assert is_robust(axis_margins(replace(found, feedforward=None), axis, sensing))
    gains = BY_HAND.gains
    rows = np.array([gains.Kp[axis], gains.Ki[axis], gains.Kd[axis]])
    by_hand = [with_gains(BY_HAND, axis, factor * rows) for factor in (0.5, 1.0)]
    kept = [one for one in by_hand if keeps(one, axis, sensing)]
    assert kept
    assert all(moved(found, axis, sensing) < 0.8 * moved(one, axis, sensing) for one in kept)


@pytest.mark.slow
def test_gains_of_this_project_that_are_robust_reject_no_better():
    sensing = Sensing("relative", 0.09)
    assert keeps(loop("ames"), YAW, sensing)
    assert moved(best("ames", YAW, 0.09), YAW, sensing) < moved(loop("ames"), YAW, sensing)
    assert not keeps(loop("ames"), X, sensing)  # it rejects better, with too little to spare


@pytest.mark.slow
def test_nothing_else_is_changed_and_the_same_is_found_again():
    found = best("ames", X, 0.09).gains
    np.testing.assert_array_equal(found.Kp[1:], loop("ames").gains.Kp[1:])
    again = tuned(loop("ames"), [X], Sensing("relative", 0.09), GOALS)
    np.testing.assert_array_equal(found.Kp, again.Kp)


@pytest.mark.slow
def test_all_gains_half_as_large_or_twice_are_no_better_where_the_margins_are_kept():
    sensing, found = Sensing("relative", 0.09), best("ames", X, 0.09)
    least = moved(found, X, sensing)
    rows = np.array([found.gains.Kp[X], found.gains.Ki[X], found.gains.Kd[X]])
    for factors in np.array(np.meshgrid(*3 * [(0.6, 1.0, 1.6)])).reshape(3, -1).T:
        other = with_gains(found, X, factors * rows)
        assert moved(other, X, sensing) > 0.99 * least or not keeps(other, X, sensing)


def test_motion_by_a_disturbance_is_that_of_a_simulation():
    without = replace(loop("ames"), feedforward=None)
    still = with_gains(without, X, np.array([1e-9, 0.0, 1e-9]))
    d, corner = still.dynamics, np.pi
    P = 1.0 / (d.inertia[X] * S * S + d.damping[X] * S + d.stiffness[X])
    rng, h = np.random.default_rng(1), 0.005
    force, x, v, sum2, n = 0.0, 0.0, 0.0, 0.0, 400_000
    noise, fade = rng.standard_normal(n), np.exp(-corner * h)
    for k in range(n):
        force = fade * force + np.sqrt(1.0 - fade**2) * noise[k]
        v += h * (force - d.damping[X] * v - d.stiffness[X] * x) / d.inertia[X]
        x += h * v
        sum2 += x * x
    assert OMEGA[0] < np.abs(S[np.abs(P).argmax()]) < OMEGA[-1]
    simulated = np.sqrt(sum2 / n)
    assert moved(still, X, Sensing("relative", 0.09)) == pytest.approx(simulated, rel=0.1)


@pytest.mark.slow
def test_margins_that_nothing_keeps_are_told_with_their_axis_and_what_binds():
    goals = MarginGoals(4.0, radians(70.0), 0.05)
    with pytest.raises(TuningError, match=r"no gains on roll .*; the nearest: .* instead of "):
        tuned(loop("ames"), [ROLL], Sensing("none", 0.25), goals)
