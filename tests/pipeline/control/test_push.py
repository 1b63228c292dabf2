"""What pushes is told from a place by how quickly it comes, and only where that can be known."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.control.push import (
    FOUND_S,
    IN_TRANSIT,
    PUSH_BEGINS_S,
    PUSH_BEGUN_S,
    PUSH_STAYS_S,
    PUSHED_N,
    TOUCHED_N,
    PushObserver,
)
from pipeline.frames import Array

H, PUSH_IN_F, NOTHING = 0.005, np.array([0.0, -3.0, 1.0]), np.zeros(3)


def observe(
    push: PushObserver, seconds: float, by_in_f: Array, to_come_n: float = 0.0, is_off: bool = False
) -> list[bool]:
    """Let something push so long; what is known of it already is not missed."""
    return [
        push.observe(by_in_f - push.force_in_f, to_come_n, H, is_off=is_off)
        for _ in range(round(seconds / H))
    ]


def untouched() -> PushObserver:
    """One that has seen nothing for long enough."""
    push = PushObserver()
    assert not any(observe(push, FOUND_S + PUSH_BEGINS_S, NOTHING)[round(PUSH_BEGINS_S / H) :])
    assert push.is_told_apart
    return push


def test_a_touch_is_learnt_in_a_moment_and_then_known_for_as_long_as_it_stays() -> None:
    push = untouched()
    learning = observe(push, 1.0, PUSH_IN_F)
    assert learning.count(True) * H == pytest.approx(PUSH_BEGINS_S + 0.1, abs=0.1)
    assert not learning[-1]
    np.testing.assert_allclose(push.known_in_f, PUSH_IN_F, rtol=0.03)
    for _ in range(round(PUSH_STAYS_S / H)):  # nothing is missed: who stands still shows nothing
        push.observe(NOTHING, 0.0, H, is_off=False)
    np.testing.assert_allclose(push.known_in_f, np.exp(-1.0) * PUSH_IN_F, rtol=0.05)


def test_what_is_let_go_of_is_learnt_as_quickly() -> None:
    push = untouched()
    observe(push, 1.0, PUSH_IN_F)
    observe(push, 1.0, NOTHING)
    np.testing.assert_allclose(push.known_in_f, NOTHING, atol=0.05)


def test_while_a_touch_is_learnt_it_is_new_and_not_told_apart() -> None:
    push, hard_in_f = untouched(), 2.0 * PUSHED_N * np.array([1.0, 0.0, 0.0])
    observe(push, 0.1, hard_in_f)
    assert (push.is_new, push.is_told_apart) == (True, False)
    observe(push, 0.9, hard_in_f)
    assert (push.is_new, push.is_told_apart) == (False, True)


def test_what_thrusters_are_on_their_way_to_give_is_no_touch() -> None:
    push = untouched()
    missed_in_f = np.array([TOUCHED_N + 0.9 * IN_TRANSIT * 4.0, 0.0, 0.0])
    assert not any(observe(push, 1.0, missed_in_f, to_come_n=4.0))
    assert any(observe(untouched(), 1.0, missed_in_f, to_come_n=3.0))


def test_a_touch_is_no_push_before_place_and_velocity_are_right() -> None:
    push = PushObserver()
    observe(push, FOUND_S - 0.1, NOTHING)
    assert not any(observe(push, 1.0, PUSH_IN_F))
    assert not push.force_in_f.any()


def test_what_goes_on_and_on_is_a_wall_that_it_rubs_along() -> None:
    push, told = untouched(), []
    for k in range(round(2.0 * PUSH_BEGUN_S / H)):
        told += observe(push, H, PUSH_IN_F * (1 + k % 100 // 50 * 2))
    assert any(told)
    assert not told[-1]
    assert not push.force_in_f.any()
    assert not push.is_told_apart


def test_without_thrust_nothing_is_kept_apart() -> None:
    push = untouched()
    observe(push, 1.0, PUSH_IN_F)
    assert not any(observe(push, 0.1, PUSH_IN_F, is_off=True))
    assert not push.force_in_f.any()


def swings(push: PushObserver, seconds: float, most_n: float) -> list[bool]:
    """Nobody pushes, but so much is missed as a robot of another weight does that swings."""
    return [
        push.observe(np.array([most_n * np.sin(8.0 * k * H), 0.0, 0.0]), 0.0, H, is_off=False)
        for k in range(round(seconds / H))
    ]


def test_what_is_missed_all_the_time_is_no_touch_and_what_is_more_than_that_is() -> None:
    push = PushObserver()
    for most_n in (0.4, 0.8, 1.2):
        swings(push, 6.0, most_n)
    assert not any(swings(push, 6.0, 1.3))
    assert push.is_told_apart
    assert observe(push, 0.5, 5.0 * PUSH_IN_F / np.linalg.norm(PUSH_IN_F)).count(True) > 50


def test_who_misses_as_much_as_a_touch_all_the_time_can_tell_nothing() -> None:
    push = PushObserver()
    for most_n in (0.5, 1.0, 1.5, 2.0):
        swings(push, 6.0, most_n)
    assert not push.is_told_apart
    assert not any(observe(push, 0.5, 8.0 * PUSH_IN_F))
    assert not push.force_in_f.any()


def test_what_begins_to_sway_as_much_as_a_touch_ends_in_no_push_and_is_not_untouched() -> None:
    """A vibration beside the sample rate, say: what it misses becomes usual while it is a touch."""
    push = untouched()
    for k in range(round(1.4 / H)):
        missed_in_f = np.array([2.5 * np.sin(19.0 * k * H), 0.0, 0.0]) - push.force_in_f
        push.observe(missed_in_f, 0.0, H, is_off=False)
        if k * H > PUSH_BEGINS_S:
            assert not push.is_told_apart
            assert push.untouched_s < PUSH_BEGINS_S
    assert not push.force_in_f.any()
