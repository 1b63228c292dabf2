"""The worst margins: no body in the stated range has less, and what control was told stays told."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, radians

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from pipeline.config import FeedForwardConfig, MarginsConfig
from pipeline.control.margins import OMEGA, UNSTABLE, AxisMargins, Loop, Sensing, axis_margins
from pipeline.control.robust_margins import MarginGoals, is_robust, worst_margins
from pipeline.estimator_config import NoFilterConfig
from pipeline.gains import PHONE, Gains

LATE = Sensing("relative", latency=0.12)
X, YAW = 0, 5


def shipped(feedforward: FeedForwardConfig | None = None) -> Loop:
    robot_file = load_robot("ames")
    dynamics = dynamics_of(robot_file.robot, robot_file.plant)
    return Loop(dynamics, PHONE, MarginsConfig(), NoFilterConfig(), feedforward)


@pytest.mark.parametrize("axis", range(6))
def test_no_body_at_the_border_of_the_range_has_less_than_the_worst(axis: int) -> None:
    loop = shipped()
    worst = worst_margins(loop, axis, LATE)
    for mass, lag, unfelt in ((0.7, 1.5, 0.2), (1.3, 1.5, 0.0), (1.0, 1.0, 0.2)):
        told = loop.dynamics
        body = replace(told, inertia=mass * told.inertia, lag=lag * told.lag)
        one = replace(loop, dynamics=body, config=replace(loop.config, unfelt=unfelt))
        found = axis_margins(one, axis, LATE)
        assert worst.phase <= found.phase
        assert worst.delay <= found.delay
        assert worst.gain_up <= found.gain_up
        assert worst.gain_down >= found.gain_down
        assert worst.peak >= found.peak


def test_both_assumptions_on_what_is_felt_count_whichever_the_settings_take() -> None:
    loop = shipped(FeedForwardConfig())
    felt, unfelt = (
        axis_margins(replace(loop, config=replace(loop.config, unfelt=share)), X, LATE)
        for share in (0.0, 0.2)
    )
    worst = worst_margins(loop, X, LATE)
    assert felt.delay < unfelt.delay  # the safer assumption is not the one with a mistake
    assert worst.delay <= felt.delay


def test_a_body_that_is_heavier_than_told_pulls_where_it_is_not_pulled() -> None:
    loop = shipped(FeedForwardConfig())
    heavy = replace(loop, dynamics=replace(loop.dynamics, inertia=1.3 * loop.dynamics.inertia))
    believed = replace(heavy, nominal=loop.dynamics)
    told, known = (one.open_loop(X, LATE)[0] for one in (believed, heavy))
    slow = np.argmin(np.abs(OMEGA - 3.0))
    assert abs(told[slow] / known[slow] - 1.0) > 0.05
    still = replace(believed, feedforward=None), replace(heavy, feedforward=None)
    told, known = (one.open_loop(YAW, LATE)[0] for one in still)
    assert np.allclose(told, known)


def test_the_peak_is_that_of_a_disturbance_in_the_closed_loop() -> None:
    """Of a mass m with damping Kd and stiffness Kp alone the sensitivity is known."""
    m, Kp, Kd = 2.0, 2.0, 1.6  # slow beside the hold of 5 ms
    loop = shipped()
    body = replace(
        loop.dynamics,
        inertia=np.full(6, m),
        damping=np.zeros(6),
        stiffness=np.zeros(6),
        lag=1e-6,
        delay=0.0,
    )
    none = np.zeros(6)
    gains = Gains(np.full(6, Kp), none, np.full(6, Kd))
    felt = replace(loop.config, unfelt=0.0)
    ideal = replace(loop, dynamics=body, gains=gains, config=felt)
    s = 1j * OMEGA
    exact = np.abs(m * s * s / (m * s * s + Kd * s + Kp)).max()
    fresh = Sensing("relative", latency=0.0, body_age=0.0)
    assert axis_margins(ideal, YAW, fresh).peak == pytest.approx(exact, rel=0.02)


def test_gains_that_are_robust_lose_it_when_they_are_turned_up() -> None:
    loop = shipped()
    soft = replace(loop, gains=Gains(0.25 * PHONE.Kp, 0.05 * PHONE.Ki, 0.7 * PHONE.Kd))
    hard = replace(loop, gains=Gains(4.0 * PHONE.Kp, 4.0 * PHONE.Ki, 4.0 * PHONE.Kd))
    assert is_robust(worst_margins(soft, X, LATE))
    worst = worst_margins(hard, X, LATE)
    assert not is_robust(worst)
    assert degrees(worst.phase) < 30.0


def test_what_a_loop_lacks_is_said_and_what_it_has_is_not() -> None:
    enough = AxisMargins(True, 0.02, radians(31.0), 2.1, 0.4, 9.0, 1.9)
    goals = MarginGoals(delay=0.01)
    assert goals.lacking(enough) == ""
    for change, words in (
        ({"phase": radians(28.0)}, "28.0° of phase instead of 30°"),
        ({"gain_up": 1.5}, "gain 3.5 dB instead of 6"),
        ({"gain_down": 0.8}, "gain 1.9 dB instead of 6"),
        ({"peak": 2.5}, "peak 2.50 instead of 2"),
        ({"delay": 0.005}, "5.0 ms of delay instead of 10"),
    ):
        assert goals.lacking(replace(enough, **change)) == words
    both = replace(enough, phase=radians(28.0), peak=2.5)
    assert goals.lacking(both) == "28.0° of phase instead of 30°, peak 2.50 instead of 2"
    assert goals.lacking(UNSTABLE) == "unstable"
    assert goals.lacking(replace(enough, gain_down=0.0)) == ""


@pytest.mark.parametrize("name", ["ames", "quadrotor"])
def test_attitudes_have_what_engineers_ask_for_with_pictures_90_ms_late(name: str) -> None:
    robot_file = load_robot(name)
    dynamics, gains = dynamics_of(robot_file.robot, robot_file.plant), robot_file.gains["phone"]
    loop = Loop(dynamics, gains, MarginsConfig(), NoFilterConfig(), FeedForwardConfig())
    for axis in (3, 4, 5):
        assert is_robust(worst_margins(loop, axis, Sensing("relative", latency=0.09)))
