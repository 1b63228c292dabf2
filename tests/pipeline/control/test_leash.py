"""The leash: nothing changes within reach, and beyond it the border is neared and never passed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import LeashConfig
from pipeline.control.leash import Leash, leash_of
from pipeline.control.pid import PoseError
from pipeline.control.reach import ThrustReach
from pipeline.frames import Array, exp

AMES = load_robot("ames").robot
CONFIG = LeashConfig(enabled=True)
R_FV, R_FR = exp(np.array([0.1, -0.2, 0.5])), exp(np.array([0.05, 0.1, -0.3]))
X_IN_F, V_IN_F = np.array([0.03, -0.04, 0.02]), np.array([0.1, 0.2, -0.05])
TURN, TURN_RATE = np.array([0.1, 0.0, 0.2]), np.array([0.0, 0.3, 0.1])
AWAY = np.random.default_rng(3).normal(size=(30, 3))


def error_to(x_r_in_f: Array, v_r_in_f: Array) -> PoseError:
    """Of a robot at `X_IN_F` [m] that goes `V_IN_F` [m/s]."""
    way = R_FV.T @ (x_r_in_f - X_IN_F), R_FV.T @ (v_r_in_f - V_IN_F)
    return PoseError(*way, TURN, TURN_RATE)


def led_to(leash: Leash, x_r_in_f: Array, v_r_in_f: Array | None = None) -> tuple[Array, Array]:
    """(Place, velocity) in f that the leash makes of a reference's."""
    v_r_in_f = np.zeros(3) if v_r_in_f is None else v_r_in_f
    error = leash.hold(error_to(x_r_in_f, v_r_in_f), R_FV, R_FR, X_IN_F, V_IN_F).error
    return X_IN_F + R_FV @ error.e_p_in_v, V_IN_F + R_FV @ error.e_p_rate_in_v


def taken(x_in_f: Array) -> float:
    reach = ThrustReach(AMES, CONFIG.kept * AMES.f_max)
    return reach.taken(R_FR.T @ (AMES.stiffness_in_f * x_in_f))[0]


def test_within_reach_the_error_is_the_same_object() -> None:
    leash = Leash(AMES, CONFIG)
    for away in AWAY:
        near = 0.999 * CONFIG.free / taken(away) * away
        error = error_to(near, np.zeros(3))
        held = leash.hold(error, R_FV, R_FR, X_IN_F, V_IN_F)
        assert held.error is error
        assert held.shares_in_f is None
        assert not held.at_limit


def test_beyond_it_the_robot_is_led_to_the_border_the_same_way_however_far() -> None:
    leash = Leash(AMES, CONFIG)
    for away in AWAY:
        border = away / taken(away)
        for times in (1.0, 1.2, 3.0, 20.0):
            place, _ = led_to(leash, times * border)
            np.testing.assert_allclose(np.cross(place, border), np.zeros(3), atol=1e-12)
            assert CONFIG.free < taken(place) < 1.0 + 1e-12
        assert taken(place) == pytest.approx(1.0, abs=1e-6)


def test_it_says_that_it_is_at_its_limit_as_the_reference_leaves_the_reach() -> None:
    leash = Leash(AMES, CONFIG)
    for away in AWAY:
        border = away / taken(away)
        for times, said in ((0.99, False), (1.01, True)):
            error = error_to(times * border, np.zeros(3))
            assert leash.hold(error, R_FV, R_FR, X_IN_F, V_IN_F).at_limit is said


@pytest.mark.parametrize("times", [0.5, 0.9, 1.0, 1.5])
def test_its_velocity_and_shares_are_what_differences_of_its_places_say(times: float) -> None:
    leash, step = Leash(AMES, CONFIG), 1e-6
    for away, v_r_in_f in zip(AWAY, AWAY[::-1], strict=True):
        x_r_in_f = times / taken(away) * away
        ahead, _ = led_to(leash, x_r_in_f + step * v_r_in_f)
        behind, _ = led_to(leash, x_r_in_f - step * v_r_in_f)
        differences = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(led_to(leash, x_r_in_f, v_r_in_f)[1], differences, atol=1e-6)
        held = leash.hold(error_to(x_r_in_f, v_r_in_f), R_FV, R_FR, X_IN_F, V_IN_F)
        shares_in_f = np.eye(3) if held.shares_in_f is None else held.shares_in_f
        np.testing.assert_allclose(shares_in_f @ v_r_in_f, differences, atol=1e-6)


def test_it_lets_turns_alone() -> None:
    held = Leash(AMES, CONFIG).hold(error_to(AWAY[0], V_IN_F), R_FV, R_FR, X_IN_F, V_IN_F)
    assert held.error.e_eta_in_b is TURN
    assert held.error.e_eta_rate_in_b is TURN_RATE


@pytest.mark.parametrize("name", ["quadrotor", "ground"])
def test_what_hangs_from_nothing_has_no_leash(name: str) -> None:
    assert leash_of(load_robot(name).robot, CONFIG) is None


def test_who_does_not_ask_for_one_is_told_of_the_end_of_its_reach_and_held_nowhere() -> None:
    leash = leash_of(AMES, LeashConfig())
    assert leash is not None
    for away in AWAY:
        for times, said in ((0.99, False), (1.01, True), (20.0, True)):
            error = error_to(times / taken(away) * away, np.zeros(3))
            held = leash.hold(error, R_FV, R_FR, X_IN_F, V_IN_F)
            assert (held.error is error, held.shares_in_f, held.at_limit) == (True, None, said)


def test_without_any_reach_nothing_is_told_and_no_leash_can_be_asked_for() -> None:
    weak = replace(AMES, f_max=1.001 * AMES.f_min)
    assert leash_of(weak, LeashConfig()) is None
    with pytest.raises(ValueError, match="reach"):
        leash_of(weak, CONFIG)


@pytest.mark.parametrize("name", ["kept", "free"])
@pytest.mark.parametrize("value", [-0.1, 1.0, np.nan])
def test_shares_that_are_none_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"leash.{name}"):
        LeashConfig(**{name: value})
