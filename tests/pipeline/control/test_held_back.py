"""Whether a robot that is told a twist is held back."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import COMMANDS, load_robot
from pipeline.control.held_back import HeldBack

ROBOT = load_robot("so101", takes=COMMANDS).robot
DRIVE, PERIOD_S = replace(ROBOT.twist, lag_s=0.03), 0.005


def watched(told, moves, seconds=3.0):
    """`taken` in each period of `told(t)` and `moves(t)`."""
    held, rows = HeldBack(DRIVE, ROBOT.axes), []
    for t in np.arange(0.0, seconds, PERIOD_S):
        held.watch(told(t), moves(t), PERIOD_S)
        rows.append(held.taken)
    return np.array(rows)


def wave(t, late_s=0.0, share=1.0):
    """A quick hand: 0.2 m/s and 45 °/s, once a second."""
    if t < late_s:
        return np.zeros(6)
    turn = np.sin(2.0 * np.pi * (t - late_s))
    return share * turn * np.array([0.2, 0.1, -0.1, 0.5, 0.5, 0.0])


@pytest.mark.parametrize("late_s", [0.03, 0.04, 0.05])
def test_one_that_follows_is_free_even_if_its_lag_is_another_one(late_s):
    assert watched(wave, lambda t: wave(t, late_s)).max() < 0.8


def test_one_that_slips_is_free():
    assert watched(wave, lambda t: wave(t, 0.04, 0.9)).max() < 0.9


@pytest.mark.parametrize("axis", range(5))
def test_one_that_stands_at_a_border_is_held_after_half_a_second(axis):
    told = 0.2 * np.eye(6)[axis] * (1.0 if axis < 3 else 4.0)
    taken = watched(lambda _: told, lambda _: np.zeros(6))
    assert taken[round(0.5 / PERIOD_S) :].min() > 1.0


def test_one_that_goes_along_a_border_is_held_too():
    told = np.array([0.2, 0.1, 0.0, 0.0, 0.0, 0.0])
    along = np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    assert watched(lambda _: told, lambda _: along)[-1] > 1.0


def test_axes_that_it_is_not_led_along_or_about_do_not_count():
    turns = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert watched(lambda _: np.zeros(6), lambda _: turns).max() == 0.0


def test_let_free_or_begun_anew_it_is_held_no_more():
    told = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    held = HeldBack(DRIVE, ROBOT.axes)
    for _ in range(400):
        held.watch(told, np.zeros(6), PERIOD_S)
    held.watch(told, None, PERIOD_S)
    assert held.taken == 0.0
    for moves in 400 * [np.zeros(6)] + 400 * [told]:
        held.watch(told, moves, PERIOD_S)
    assert held.taken < 0.1
