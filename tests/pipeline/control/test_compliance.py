"""Compliance: no more force than allowed, no bouncing, no jump, also not when the wall goes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.config import ComplianceConfig
from pipeline.control.compliance import Compliance
from pipeline.control.pid import Pid, Reference, pose_error
from pipeline.gains import PHONE
from pipeline.signals import VirtualView

H, LIMIT = 0.005, 3.0
ON = ComplianceConfig(enabled=True, limit_n=LIMIT)
MASS, AIR = 3.5, 1.5
WALL = 0.1
ALONG, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Flight:
    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    command: np.ndarray
    contact: np.ndarray
    lost: int


def fly(
    config: ComplianceConfig | None = ON,
    seconds: float = 14.0,
    speed: float = 0.1,
    behind: float = 0.2,
    wall: Callable[[float], bool] = lambda t: t < 9.0,
    stiffness: float = 1e4,
    pull: float = 0.0,
) -> Flight:
    """Along one axis after a reference that goes on `behind` a stiff wall; thrusters as the AMES'.

    Contact is lost when the body is more than half a millimetre off the wall it has touched.
    """
    pid, soft = Pid(PHONE), Compliance(config) if config is not None else None
    pid.take_over(-pull * ALONG)
    if soft is not None:
        soft.start(-pull * ALONG)
    waiting = deque([-pull] * 3)
    x = v = v_before = 0.0
    force, touching, lost, rows = -pull, False, 0, []
    damping = 0.4 * np.sqrt(stiffness * MASS)
    for k in range(round(seconds / H)):
        t = k * H
        target = min(max(t - 1.0, 0.0) * speed, WALL + behind)
        moving = speed if 0.0 < target < WALL + behind else 0.0
        view = VirtualView(np.eye(3), np.zeros(3), x * ALONG, np.eye(3), (v - moving) * ALONG, ZERO)
        error = pose_error(view, Reference(target * ALONG, np.eye(3)))
        wrench = pid.wrench(error, view)
        felt_a, v_before = (v - v_before) / H * ALONG, v
        soft_in_f, cut_in_f = wrench[:3], ZERO
        if soft is not None:
            soft_in_f = soft.force(wrench[:3], pid.braking_in_b(felt_a), (target - x) * ALONG, H)
            cut_in_f = soft.cut_in_f
        given = np.clip(soft_in_f, -6.0, 6.0)
        pid.integrate(error, view, np.append(soft_in_f - given + cut_in_f, ZERO), H)
        waiting.append(given[0])
        command, felt = waiting.popleft(), 0.0
        for _ in range(20):
            force += 2.5e-4 / 0.025 * (command - force)
            depth = x - WALL
            push = max(0.0, stiffness * depth + damping * v) if depth > 0.0 and wall(t) else 0.0
            v += 2.5e-4 * (force + pull - AIR * v - push) / MASS
            x += 2.5e-4 * v
            felt += push / 20
            touches = wall(t) and (depth > 0.0 or (touching and depth > -5e-4))
            lost += touching and not touches and wall(t)
            touching = touches
        rows.append((t, x, v, given[0], felt))
    return Flight(*np.array(rows).T, lost=int(lost))


ZERO = np.zeros(3)


@pytest.mark.parametrize(("speed", "pull"), [(0.05, 0.0), (0.1, 0.0), (0.1, -1.5)])
def test_the_push_settles_at_the_limit_and_does_not_bounce(speed: float, pull: float) -> None:
    flight = fly(speed=speed, pull=pull, seconds=4.0 + 0.3 / speed, wall=lambda t: True)
    pressing = flight.t > 2.5 + 0.3 / speed
    assert np.abs(flight.contact[pressing] - LIMIT).max() < 0.2 * LIMIT
    assert flight.lost <= 1


def test_without_compliance_the_push_is_all_the_thrusters_have() -> None:
    flight = fly(None, 9.0)
    pressing = (flight.t > 7.0) & (flight.t < 9.0)
    assert flight.contact[pressing].min() > 5.5


def test_when_the_wall_goes_it_returns_to_the_reference_without_a_jump() -> None:
    flight = fly()
    after = flight.t >= 9.0
    assert np.abs(np.diff(flight.command[after])).max() < 0.15
    assert flight.x[after].max() < 1.05 * (WALL + 0.2)
    assert flight.v[after].max() < 0.3
    assert flight.x[-1] == pytest.approx(WALL + 0.2, abs=0.005)


def test_in_the_free_it_changes_nothing() -> None:
    with_it, without = (fly(config, 6.0, wall=lambda t: False) for config in (ON, None))
    np.testing.assert_array_equal(with_it.x, without.x)


def test_a_reference_just_behind_the_wall_is_no_harder_push_in_the_end() -> None:
    flight = fly(behind=0.01, seconds=16.0, wall=lambda t: True)
    assert flight.contact[flight.t > 3.0].max() < 1.2 * LIMIT


def test_where_it_follows_a_pull_beyond_the_limit_is_carried_and_nothing_is_cut() -> None:
    soft = Compliance(ON)
    for k in range(4000):
        force = (LIMIT + 1.5) * np.sin(0.3 * 2.0 * np.pi * k * H) * ALONG
        np.testing.assert_array_equal(soft.force(force, ZERO, 0.003 * ALONG, H), force)


def test_what_was_carried_is_no_allowance_against_a_wall() -> None:
    soft = Compliance(ON)
    for _ in range(400):
        soft.force(5.5 * ALONG, ZERO, 0.003 * ALONG, H)
    for _ in range(400):
        given = soft.force(9.0 * ALONG, ZERO, 0.05 * ALONG, H)
    assert given[0] == pytest.approx(LIMIT, abs=0.02)


def test_a_reference_within_reach_of_following_pushes_with_twice_the_limit_at_most() -> None:
    soft = Compliance(ON)
    given = [soft.force(min(9.0, 0.02 * k) * ALONG, ZERO, 0.005 * ALONG, H)[0] for k in range(4000)]
    learnt_on_the_way = 0.05
    assert max(given) < 2.0 * LIMIT + learnt_on_the_way


def test_tremor_of_the_hand_does_not_reach_the_wall_but_the_bodys_own_motion_is_damped() -> None:
    soft = Compliance(ON)
    given = []
    for k in range(1000):
        tremor = 0.3 * np.sin(2.0 * np.pi * 10.0 * k * H)
        given.append(soft.force((6.0 + tremor) * ALONG, ZERO, 0.05 * ALONG, H)[0])
    assert np.ptp(given[500:]) < 1e-3
    rebound = soft.force(6.0 * ALONG, -30.0 * 20.0 * ALONG, 0.05 * ALONG, H)[0]
    assert rebound < given[-1] - 2.0


vectors = st.tuples(*3 * [st.floats(-1.0, 1.0)]).map(np.array)


@given(
    st.lists(st.tuples(vectors, vectors, vectors), min_size=1, max_size=60),
    st.floats(0.5, 20.0),
    st.floats(0.0, 0.1),
)
def test_whatever_is_asked_for_the_push_is_bounded_and_told_in_full(
    asked: list[tuple[np.ndarray, np.ndarray, np.ndarray]], size: float, far: float
) -> None:
    soft = Compliance(ON)
    for force_in_f, braking_in_f, behind_in_f in 5 * asked:
        given_in_f = soft.force(size * force_in_f, size * braking_in_f, far * behind_in_f, H)
        pushed = given_in_f - soft._usual_in_f - soft._carried_in_f - soft._quick_in_f
        learnt_since = H / ON.usual_s * LIMIT
        assert np.linalg.norm(pushed) <= 1.06 * LIMIT + learnt_since
        assert np.linalg.norm(soft._carried_in_f) <= LIMIT * (1.0 + 1e-9)


def test_between_following_and_blocked_a_small_change_is_answered_by_a_small_one() -> None:
    """A push against the aim, half blocked: where directions were mixed, one was undefined."""
    given = []
    for tilt in np.linspace(-0.01, 0.01, 21):
        soft = Compliance(ON)
        for _ in range(1000):
            soft.force(2.4 * ALONG, ZERO, 0.009 * ALONG, H)
        given.append(soft.force(-9.0 * ALONG + tilt * UP, ZERO, 0.009 * ALONG, H))
    assert np.abs(np.diff(given, axis=0)).max() < 0.01


@pytest.mark.parametrize("name", ["limit_n", "follows_m", "quick_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_what_would_divide_by_zero_in_flight_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"compliance\.{name} .* above 0"):
        replace(ON, **{name: value})


def blocked(force: Callable[[float], np.ndarray], behind: np.ndarray) -> np.ndarray:
    """(n, 3) what is given in the last of five seconds of `force`, the reference `behind`."""
    soft = Compliance(ON)
    return np.array([soft.force(force(k * H), ZERO, behind, H) for k in range(1000)])[800:]


def test_tremor_whose_troughs_are_below_the_limit_does_not_reach_the_wall_either() -> None:
    given = blocked(lambda t: (3.4 + np.sin(20.0 * np.pi * t)) * ALONG, 0.05 * ALONG)
    np.testing.assert_allclose(given, LIMIT * np.ones((200, 1)) * ALONG, atol=1e-3)


def test_what_goes_on_across_the_push_takes_no_share_of_it() -> None:
    given = blocked(lambda t: 6.0 * ALONG + 0.9 * np.sin(20.0 * np.pi * t) * UP, 0.05 * ALONG)
    np.testing.assert_allclose(given[:, 0], LIMIT, atol=1e-3)
    assert np.ptp(given[:, 2]) == pytest.approx(1.8, rel=0.02)


def test_what_presses_across_is_bounded_by_its_part_of_the_limit() -> None:
    soft = Compliance(ON)
    given = [soft.force(6.0 * ALONG + 9.0 * UP, ZERO, 0.05 * ALONG, H) for _ in range(1000)]
    np.testing.assert_allclose(given[-1], LIMIT * ALONG + ON.across * LIMIT * UP, atol=1e-3)


def test_the_low_pass_takes_no_damping_from_the_bodys_own_motion() -> None:
    soft, damping, w, fastest = Compliance(ON), 30.0, 2.0 * np.pi * 3.0, 0.01
    missing, without = [], []
    for k in range(1000):
        v, a = fastest * np.sin(w * k * H), fastest * w * np.cos(w * k * H)
        asked = 2.4 - damping * v
        given = soft.force(asked * ALONG, -damping * a * ALONG, 0.05 * ALONG, H)
        missing.append(given[0] - asked)
        without.append(given[0] - soft._quick_in_f[0] - asked)
    assert 0.0 < np.ptp(missing[600:]) < 0.15 * 2.0 * damping * fastest < np.ptp(without[600:])
