"""How a person leads: the law of shares, and which robots can be led so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.control.leading import LEAST_SCALE, MOST_SCALE, PLAIN, Leading, aim_of, led, suits
from pipeline.control.pid import PoseError, Reference, pose_error
from pipeline.frames import Array, exp
from pipeline.signals import VirtualView

AMES = load_robot("ames").robot
R_FV0, P = exp(np.array([0.1, -0.05, 0.4])), np.array([2.5, 0.1, -0.2])
"""Attitude of v and where the body was in it, at the press."""
HAND_IN_F, TURN = np.array([0.10, -0.07, 0.05]), exp(np.array([0.02, 0.05, 0.1]))
"""How the hand has moved and turned since."""
GONE_IN_F = HAND_IN_F + (TURN @ R_FV0 - R_FV0) @ P
"""How far the paper's reference has gone with it."""


def view(x_bf_in_f: Array, turn: Array = TURN) -> VirtualView:
    """The body, `x_bf_in_f` (3,) [m] from where it was at the press, from a hand that has moved."""
    R_fv = turn @ R_FV0
    return VirtualView(
        R_fv=R_fv,
        omega_vf_in_v=np.zeros(3),
        p_bv_in_v=R_fv.T @ (R_FV0 @ P + x_bf_in_f - HAND_IN_F),
        R_vb=R_fv.T,
        v_bv_in_v=R_fv.T @ np.array([0.3, -0.2, 0.1]),
        omega_bf_in_b=np.zeros(3),
    )


def error_of(leading: Leading, x_bf_in_f: Array, v_bf_in_f: Array | None = None) -> PoseError:
    seen, v = view(x_bf_in_f), np.zeros(3) if v_bf_in_f is None else v_bf_in_f
    shares = leading.shares_in_f
    assert shares is not None
    return led(pose_error(seen, Reference(P, R_FV0.T)), seen, shares, x_bf_in_f, v)


@pytest.mark.parametrize("scale", [0.25, 0.5, 0.75])
@pytest.mark.parametrize("axes", ["all", "level", "turn"])
def test_the_error_vanishes_where_the_robot_has_gone_its_share(scale: float, axes: str) -> None:
    leading = Leading(scale, axes)
    share = {"all": (scale,) * 3, "level": (scale, scale, 0.0), "turn": (0.0,) * 3}[axes]
    there = np.array(share) * GONE_IN_F
    np.testing.assert_allclose(error_of(leading, there).e_p_in_v, np.zeros(3), atol=1e-12)
    beside = np.array([0.03, 0.0, -0.02])
    found_in_f = view(there + beside).R_fv @ error_of(leading, there + beside).e_p_in_v
    np.testing.assert_allclose(found_in_f, -beside, atol=1e-12)


def test_with_all_of_the_motion_the_law_is_the_papers() -> None:
    x, v = np.array([0.02, 0.01, -0.03]), np.array([0.1, 0.0, -0.2])
    seen = view(x)
    paper = pose_error(seen, Reference(P, R_FV0.T))
    same = led(paper, seen, np.ones(3), x, v)
    np.testing.assert_allclose(same.e_p_in_v, paper.e_p_in_v, atol=1e-15)
    np.testing.assert_allclose(same.e_p_rate_in_v, paper.e_p_rate_in_v, atol=1e-15)
    assert same.e_eta_in_b is paper.e_eta_in_b


def test_the_rate_brakes_what_the_robot_is_too_fast_for_its_share() -> None:
    """The hand goes by h, the body by v: the error changes by S h − v."""
    h_in_f, v_in_f = np.array([0.2, 0.1, -0.1]), np.array([0.1, 0.1, 0.05])
    seen = view(np.zeros(3))
    seen = replace(seen, v_bv_in_v=seen.R_fv.T @ (v_in_f - h_in_f))
    found = led(pose_error(seen, Reference(P, R_FV0.T)), seen, np.full(3, 0.5), np.zeros(3), v_in_f)
    np.testing.assert_allclose(seen.R_fv @ found.e_p_rate_in_v, 0.5 * h_in_f - v_in_f, atol=1e-12)


@pytest.mark.parametrize("scale", [LEAST_SCALE, 0.5, MOST_SCALE])
def test_what_a_blocked_robot_gives_in_vain_makes_it_push_no_harder(scale: float) -> None:
    """Its thrusters push against a wall; by them alone it is believed to have gone on."""
    seen = replace(view(np.zeros(3)), p_bv_in_v=P)
    believed_in_f = np.array([4.0, -2.0, 1.0]) / AMES.stiffness_in_f
    none = pose_error(seen, Reference(P, seen.R_vb))
    shares = np.full(3, scale)
    more_in_f = seen.R_fv @ led(none, seen, shares, believed_in_f, np.zeros(3)).e_p_in_v
    assert (more_in_f * believed_in_f <= 1e-15).all()


def test_the_aim_is_where_no_error_would_be() -> None:
    leading, x = Leading(0.5), np.array([0.01, 0.02, 0.03])
    seen = view(x)
    aim = aim_of(error_of(leading, x), seen, Reference(P, R_FV0.T))
    aim_in_f = x + seen.R_fv @ (aim.p_rv_in_v - seen.p_bv_in_v)
    np.testing.assert_allclose(aim_in_f, 0.5 * GONE_IN_F, atol=1e-12)


@pytest.mark.parametrize("name", ["quadrotor", "ground"])
def test_a_robot_that_hangs_from_nothing_is_led_by_all_or_by_shifts_alone(name: str) -> None:
    robot = load_robot(name).robot
    for leading in (PLAIN, Leading(axes="shift")):
        assert suits(leading, robot)
        assert suits(leading, AMES)
    for leading in (Leading(0.5), Leading(1, "level"), Leading(1, "turn"), Leading(0.5, "shift")):
        assert not suits(leading, robot)
        assert suits(leading, AMES)


def test_shares_are_those_of_scale_and_axes_and_none_for_all() -> None:
    assert PLAIN.shares_in_f is None
    assert Leading(axes="shift").shares_in_f is None
    for leading, shares in (
        (Leading(0.5), (0.5, 0.5, 0.5)),
        (Leading(0.5, "shift"), (0.5, 0.5, 0.5)),
        (Leading(0.5, "level"), (0.5, 0.5, 0.0)),
        (Leading(0.5, "turn"), (0.0, 0.0, 0.0)),
    ):
        found = leading.shares_in_f
        assert found is not None
        assert tuple(found.tolist()) == shares
