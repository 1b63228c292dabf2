"""The leash: nothing changes within reach, and beyond it the border is neared and never passed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import LeashConfig, ResumptionConfig
from pipeline.control.leash import Leash, Leashed, LeashedBody, leash_of
from pipeline.control.pid import PoseError
from pipeline.control.reach import ThrustReach
from pipeline.frames import Array, exp

AMES = load_robot("ames").robot
CONFIG, RESUMPTION = LeashConfig(enabled=True), ResumptionConfig()
R_FV, R_FR = exp(np.array([0.1, -0.2, 0.5])), exp(np.array([0.05, 0.1, -0.3]))
X_IN_F, V_IN_F = np.array([0.03, -0.04, 0.02]), np.array([0.1, 0.2, -0.05])
BODY, H = LeashedBody(X_IN_F, V_IN_F, is_steady=True), 0.005
SETTLES_H = 4.0 * H
"""Where it comes to after long does not depend on the step; 10 of these are what it nears in."""
TOUCHED = BODY._replace(is_steady=False)
TURN, TURN_RATE = np.array([0.1, 0.0, 0.2]), np.array([0.0, 0.3, 0.1])
ZERO = np.zeros(3)
AWAY = np.random.default_rng(3).normal(size=(30, 3))


LEAST_BORDER = (1.0 - CONFIG.kept) / (1.0 - CONFIG.kept + CONFIG.lent)
"""Of what may be passed through."""


def error_to(x_r_in_f: Array, v_r_in_f: Array) -> PoseError:
    """Of a robot at `X_IN_F` [m] that goes `V_IN_F` [m/s]."""
    way = R_FV.T @ (x_r_in_f - X_IN_F), R_FV.T @ (v_r_in_f - V_IN_F)
    return PoseError(*way, TURN, TURN_RATE)


def settled(leash: Leash, x_r_in_f: Array, body: LeashedBody = BODY) -> Leashed:
    """What it makes of a reference that has been there for long [m]."""
    error = error_to(x_r_in_f, np.zeros(3))
    for _ in range(round(15.0 * CONFIG.stays_s / SETTLES_H)):
        held = leash.hold(error, R_FV, R_FR, body, SETTLES_H)
    return held


def place_of(held: Leashed) -> Array:
    """Where a robot is led (3,) [m]."""
    place: Array = X_IN_F + R_FV @ held.error.e_p_in_v
    return place


def velocity_of(held: Leashed) -> Array:
    """How fast it is led (3,) [m/s]."""
    velocity: Array = V_IN_F + R_FV @ held.error.e_p_rate_in_v
    return velocity


def taken(x_in_f: Array) -> float:
    """Of the reach that it is held in for long."""
    reach = ThrustReach(AMES, (CONFIG.kept - CONFIG.lent) * AMES.f_max)
    return reach.taken(R_FR.T @ (AMES.stiffness_in_f * x_in_f))[0] / LEAST_BORDER


def test_within_reach_the_error_is_the_same_object() -> None:
    leash = Leash(AMES, CONFIG, RESUMPTION)
    for away in AWAY:
        near = 0.999 * CONFIG.free / taken(away) * away
        error = error_to(near, np.zeros(3))
        held = leash.hold(error, R_FV, R_FR, BODY, H)
        assert held.error is error
        assert held.shares_in_f is None
        assert not held.at_limit


def test_beyond_it_the_robot_is_led_to_the_border_the_same_way_however_far() -> None:
    leash = Leash(AMES, CONFIG, RESUMPTION)
    for away in AWAY:
        border = away / taken(away)
        leash.start()
        for times in (1.0, 1.2, 3.0, 20.0):
            place = place_of(settled(leash, times * border))
            np.testing.assert_allclose(np.cross(place, border), np.zeros(3), atol=1e-12)
            assert CONFIG.free < taken(place) < 1.0 + 1e-4
        assert taken(place) == pytest.approx(1.0, abs=1e-4)


def test_it_says_that_it_is_at_its_limit_as_the_reference_leaves_the_reach() -> None:
    leash = Leash(AMES, CONFIG, RESUMPTION)
    for away in AWAY:
        border = away / taken(away)
        for times, said in ((0.99, False), (1.01, True)):
            error = error_to(times * border, np.zeros(3))
            assert leash.hold(error, R_FV, R_FR, BODY, H).at_limit is said


def approached(speed_m_s: float, way_in_f: Array) -> list[Leashed]:
    """What is made of a reference that goes out from the robot's rest, and back after 2 s."""
    leash, held = Leash(AMES, CONFIG, RESUMPTION), []
    for k in range(round(8.0 / H)):
        t = k * H
        out = t < 2.0
        x_r_in_f = speed_m_s * (t if out else max(0.0, 4.0 - t)) * way_in_f
        v_r_in_f = (1.0 if out else -1.0) * speed_m_s * way_in_f if t < 4.0 else np.zeros(3)
        held.append(leash.hold(error_to(x_r_in_f, v_r_in_f), R_FV, R_FR, BODY, H))
    return held


@pytest.mark.parametrize("speed_m_s", [0.1, 0.3, 0.5])
def test_a_fast_reference_is_braked_before_the_border(speed_m_s: float) -> None:
    for away in AWAY[:6]:
        way = away / np.linalg.norm(away)
        held = approached(speed_m_s, way)
        far = np.array([taken(place_of(one)) for one in held])
        v = np.array([velocity_of(one) @ way for one in held])
        assert far.max() < 1.0 / LEAST_BORDER + 1.2 * H * speed_m_s * taken(way)  # a period's way
        assert np.abs(np.diff(v[: round(2.0 / H)])).max() / H < 1.1 * speed_m_s / CONFIG.nears_s
        assert held[-1].error.e_p_in_v == pytest.approx(error_to(ZERO, ZERO).e_p_in_v, abs=2e-4)


@pytest.mark.parametrize("speed_m_s", [0.1, 0.3, 0.5])
def test_its_velocity_and_acceleration_are_what_differences_of_its_places_say(
    speed_m_s: float,
) -> None:
    for away in AWAY[:6]:
        held = approached(speed_m_s, away / np.linalg.norm(away))
        p, v = (np.array([of(one) for one in held]) for of in (place_of, velocity_of))
        brakes = np.array([ZERO if one.brakes_in_f is None else one.brakes_in_f for one in held])
        span = slice(1, round(2.0 / H) - 1)
        assert np.diff(p, axis=0)[span] / H == pytest.approx(v[1:][span], abs=1e-6)
        most = 0.15 + 0.06 * speed_m_s / CONFIG.nears_s  # by the border, which draws in
        assert np.diff(v, axis=0)[span] / H == pytest.approx(brakes[1:][span], abs=most)


def offset(held: Leashed, x_r_in_f: Array) -> Array:
    """What was taken off a reference (3,) [m]."""
    x_l_in_f: Array = X_IN_F + R_FV @ held.error.e_p_in_v
    return x_l_in_f - x_r_in_f


def test_while_something_else_pushes_the_hand_leads_by_all_of_its_motion() -> None:
    """What it has taken off by then stays taken off, wherever the push seems to put the robot."""
    for away in AWAY:
        leash = Leash(AMES, CONFIG, RESUMPTION)
        border = away / taken(away)
        at_touch = offset(settled(leash, 1.2 * border), 1.2 * border)
        assert np.linalg.norm(at_touch) > 0.01
        for times in (1.2, 0.3, 5.0):
            error = error_to(times * border, 2.0 * V_IN_F)
            held = leash.hold(error, R_FV, R_FR, TOUCHED, H)
            np.testing.assert_allclose(offset(held, times * border), at_touch, atol=1e-12)
            assert held.error.e_p_rate_in_v is error.e_p_rate_in_v
            assert held.shares_in_f is None
            assert held.at_limit is (times > 1.0)


def test_what_touches_within_reach_is_led_as_without_a_leash() -> None:
    leash, error = Leash(AMES, CONFIG, RESUMPTION), error_to(0.2 * AWAY[0], V_IN_F)
    assert leash.hold(error, R_FV, R_FR, TOUCHED, H).error is error


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_once_the_push_is_over_the_leash_is_gone_back_to_no_faster_than_after_a_gap(
    times: float,
) -> None:
    for away in AWAY:
        leash = Leash(AMES, CONFIG, RESUMPTION)
        border = away / taken(away)
        settled(leash, 1.2 * border)
        before = leash.hold(error_to(times * border, V_IN_F), R_FV, R_FR, TOUCHED, H)
        at = offset(before, times * border)
        for _ in range(2000):
            held = leash.hold(error_to(times * border, ZERO), R_FV, R_FR, BODY, H)
            then, at = at, offset(held, times * border)
            assert np.linalg.norm(at - then) <= 1.001 * H * RESUMPTION.max_speed_m_s
        wanted = Leash(AMES, CONFIG, RESUMPTION)
        held = settled(wanted, times * border)
        np.testing.assert_allclose(at, offset(held, times * border), atol=1e-4)


def test_another_press_takes_nothing_off() -> None:
    leash, border = Leash(AMES, CONFIG, RESUMPTION), AWAY[0] / taken(AWAY[0])
    leash.hold(error_to(1.5 * border, V_IN_F), R_FV, R_FR, BODY, H)
    leash.start()
    error = error_to(0.5 * border, V_IN_F)
    assert leash.hold(error, R_FV, R_FR, TOUCHED, H).error is error
    assert leash.hold(error, R_FV, R_FR, BODY, H).error is error


def test_it_lets_turns_alone() -> None:
    held = Leash(AMES, CONFIG, RESUMPTION).hold(error_to(AWAY[0], V_IN_F), R_FV, R_FR, BODY, H)
    assert held.error.e_eta_in_b is TURN
    assert held.error.e_eta_rate_in_b is TURN_RATE


@pytest.mark.parametrize("name", ["quadrotor", "ground"])
def test_what_hangs_from_nothing_has_no_leash(name: str) -> None:
    assert leash_of(load_robot(name).robot, CONFIG, RESUMPTION) is None


def test_who_does_not_ask_for_one_is_told_of_the_end_of_its_reach_and_held_nowhere() -> None:
    leash = leash_of(AMES, LeashConfig(enabled=False), RESUMPTION)
    assert leash is not None
    for away in AWAY:
        for times, said in ((0.99, False), (1.01, True), (20.0, True)):
            error = error_to(times / taken(away) * away, np.zeros(3))
            held = leash.hold(error, R_FV, R_FR, BODY, H)
            assert (held.error is error, held.shares_in_f, held.at_limit) == (True, None, said)


def test_without_any_reach_nothing_is_told_and_no_leash_can_be_asked_for() -> None:
    weak = replace(AMES, f_max=1.001 * AMES.f_min)
    assert leash_of(weak, LeashConfig(enabled=False), RESUMPTION) is None
    with pytest.raises(ValueError, match="reach"):
        leash_of(weak, CONFIG, RESUMPTION)


@pytest.mark.parametrize("name", ["kept", "free"])
@pytest.mark.parametrize("value", [-0.1, 1.0, np.nan])
def test_shares_that_are_none_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"leash.{name}"):
        LeashConfig(**{name: value})


@pytest.mark.parametrize("name", ["nears_s", "stays_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, 6.0, np.nan])
def test_times_that_are_none_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"leash.{name}"):
        LeashConfig(**{name: value})


@pytest.mark.parametrize("value", [-0.1, 0.2, np.nan])
def test_no_more_is_lent_than_is_kept(value: float) -> None:
    with pytest.raises(ValueError, match=r"leash\.lent"):
        LeashConfig(lent=value)


def test_what_is_only_passed_through_is_not_held() -> None:
    leash, border = Leash(AMES, CONFIG, RESUMPTION), AWAY[0] / taken(AWAY[0])
    for k in range(round(3.0 / H)):
        beyond = 1.05 if k % 100 < 20 else 0.8  # a tenth of a second, each half
        held = leash.hold(error_to(beyond * border, ZERO), R_FV, R_FR, BODY, H)
        assert np.linalg.norm(offset(held, beyond * border)) < 0.002
    stayed = offset(settled(leash, 1.05 * border), 1.05 * border)
    assert np.linalg.norm(stayed) > 0.008
