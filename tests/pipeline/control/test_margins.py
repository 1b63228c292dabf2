"""Margins: what is said to be the border of stability is, and the paper's robot has what it has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from pipeline.config import FeedForwardConfig, MarginsConfig
from pipeline.control.dynamics import Dynamics
from pipeline.control.margins import Loop, Sensing, axis_margins, delay_margin
from pipeline.estimator_config import NoFilterConfig
from pipeline.gains import PHONE, TABLE_II_WITH_EKF, TABLE_II_WITHOUT_EKF, Gains
from tests.pipeline.control import one_axis
from tests.pipeline.control.one_axis import H

FRESH = Sensing("relative", latency=0.0, body_age=0.0)
X, Y, Z, ROLL, PITCH, YAW = range(6)


def dynamics(**changes: object) -> Dynamics:
    robot_file = load_robot("ames")
    return replace(dynamics_of(robot_file.robot, robot_file.plant), **changes)


def loop(gains: Gains, plant: Dynamics, feedforward: FeedForwardConfig | None = None) -> Loop:
    return Loop(plant, gains, MarginsConfig(unfelt=0.0), NoFilterConfig(), feedforward)


def grows(gains: Gains, plant: Dynamics, axis: int, late: float, gain: float = 1.0) -> bool:
    """Whether a body under the PID with all its gains times `gain` goes off."""
    integral = 0.0

    def control(x: float, v: float) -> float:
        nonlocal integral
        integral -= gain * gains.Ki[axis] * x * H
        return integral - gain * float(gains.Kp[axis] * x + gains.Kd[axis] * v)

    return one_axis.grows(plant, axis, late, control)


@pytest.mark.parametrize(("gains", "axis"), [(PHONE, X), (TABLE_II_WITHOUT_EKF, YAW)])
def test_beyond_the_delay_margin_a_simulation_diverges_and_within_it_does_not(
    gains: Gains, axis: int
) -> None:
    plant = dynamics()
    margin = axis_margins(loop(gains, plant), axis, FRESH).delay
    assert not grows(gains, plant, axis, 0.94 * margin)
    assert grows(gains, plant, axis, 1.06 * margin)


def test_beyond_the_gain_margins_a_simulation_diverges_and_within_them_does_not() -> None:
    plant, gains = dynamics(), TABLE_II_WITHOUT_EKF
    found = axis_margins(loop(gains, plant), ROLL, FRESH)
    assert not grows(gains, plant, ROLL, 0.0, 0.95 * found.gain_up)
    assert grows(gains, plant, ROLL, 0.0, 1.05 * found.gain_up)
    assert 0.0 < found.gain_down < 1.0
    assert grows(gains, plant, ROLL, 0.0, 0.9 * found.gain_down)
    assert not grows(gains, plant, ROLL, 0.0, 1.1 * found.gain_down)


@pytest.mark.parametrize(
    ("gains", "all_late", "place_late"),
    [
        (TABLE_II_WITH_EKF, (100, 100, 75, 35, 35, 38), (290, 290, 165, 110, 110, 155)),
        (TABLE_II_WITHOUT_EKF, (150, 135, 110, 30, 30, 110), (140, 135, 150, 40, 40, 205)),
    ],
)
def test_the_papers_gains_bear_the_delays_that_are_known(
    gains: Gains, all_late: tuple[float, ...], place_late: tuple[float, ...]
) -> None:
    """Milliseconds of a simulated AMES with thrusters of 20 ms lag and 10 ms delay.

    The first figures are for everything as late, the second for a derivative that is not.
    """
    plant = dynamics(lag=0.020, delay=0.010)
    nothing = np.zeros(6)
    for axis in range(6):
        whole, _ = loop(gains, plant).open_loop(axis, FRESH)
        rate, _ = loop(Gains(nothing, nothing, gains.Kd), plant).open_loop(axis, FRESH)
        assert 1e3 * delay_margin(whole) == pytest.approx(all_late[axis], rel=0.15)
        assert 1e3 * delay_margin(whole - rate, rate) == pytest.approx(place_late[axis], rel=0.35)


def test_an_unstable_loop_is_told_from_a_stable_one_with_the_same_crossings() -> None:
    heavy = dynamics(inertia=np.full(6, 5.0), stiffness=np.zeros(6))
    found = axis_margins(loop(TABLE_II_WITHOUT_EKF, heavy), X, FRESH)  # Routh: below 3.3 kg
    assert not found.stable
    assert found.delay == 0.0
    light = dynamics(inertia=np.full(6, 2.0), stiffness=np.zeros(6))
    assert axis_margins(loop(TABLE_II_WITHOUT_EKF, light), X, FRESH).stable


def test_an_undamped_pendulum_is_no_puzzle() -> None:
    still = dynamics(damping=np.zeros(6))
    assert axis_margins(loop(PHONE, still), X, FRESH).stable
    assert axis_margins(loop(PHONE, still), YAW, FRESH).stable


def test_without_a_filter_old_pictures_topple_the_robot_and_with_one_they_do_not() -> None:
    plant = dynamics()
    for axis in range(6):
        assert not axis_margins(loop(PHONE, plant), axis, Sensing("none", 0.1)).stable
        known = Loop(plant, PHONE, MarginsConfig(), NoFilterConfig())
        for latency in (0.0, 0.1, 0.3):
            margins = axis_margins(known, axis, Sensing("relative", latency))
            assert margins.stable
            assert margins.delay > 0.02


def test_older_body_samples_leave_less_margin() -> None:
    ages = [0.0, 0.01, 0.02, 0.03]
    left = [
        axis_margins(loop(PHONE, dynamics()), ROLL, Sensing("paper", 0.1, age)).delay
        for age in ages
    ]
    np.testing.assert_allclose(np.add(left, ages), left[0], atol=1e-3)


def test_feed_forward_costs_margin_but_leaves_enough() -> None:
    with_pull = loop(PHONE, dynamics(), FeedForwardConfig())
    for axis in (X, Y, Z):
        margins = axis_margins(with_pull, axis, FRESH)
        assert margins.stable
        assert margins.delay > 0.04
        assert margins.gain_up > 2.5


def test_a_robot_that_tilts_to_move_is_as_stable_as_its_attitude() -> None:
    robot_file = load_robot("quadrotor")
    plant = dynamics_of(robot_file.robot, robot_file.plant)
    gains = robot_file.gains["phone"]
    assert plant.needs_tilt
    good = loop(gains, plant)
    assert axis_margins(good, X, FRESH).stable
    assert axis_margins(good, X, FRESH).delay > axis_margins(good, PITCH, FRESH).delay
    no_attitude = Gains(gains.Kp, gains.Ki, gains.Kd * np.array([1, 1, 1, 0, 0, 1.0]))
    assert not axis_margins(loop(no_attitude, plant), X, FRESH).stable
