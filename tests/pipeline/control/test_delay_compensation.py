"""Delay compensation: as stable as the margins say, and in the way of nothing that stands still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from pipeline.config import FeedForwardConfig, MarginsConfig, TiltConfig
from pipeline.control.delay_compensation import DelayCompensation
from pipeline.control.dynamics import Dynamics
from pipeline.control.margins import Loop, Sensing, axis_margins
from pipeline.control.pid import PoseError
from pipeline.control.thruster_model import ThrusterModel
from pipeline.control.tilt import TiltToMove
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import Array, exp
from pipeline.gains import PHONE
from tests.pipeline.control import one_axis
from tests.pipeline.control.one_axis import H

AMES, QUADROTOR = load_robot("ames"), load_robot("quadrotor")
NOTHING = Sensing("relative", latency=0.0, body_age=0.0)
"""Of which a measurement is late."""
STILL = np.zeros(3)
ROLL, YAW = 3, 5


def turned(axis: int, angle: float, rate: float) -> PoseError:
    along = np.eye(3)[axis - 3]
    return PoseError(STILL, STILL, -angle * along, -rate * along)


def told(axis: int, torque: float) -> Array:
    wrench: Array = torque * np.eye(6)[axis]
    return wrench


def compensated() -> tuple[ThrusterModel, DelayCompensation]:
    thrusters = ThrusterModel(AMES.robot, 6)
    return thrusters, DelayCompensation(AMES.robot, thrusters)


def holding(torque: float, periods: int) -> DelayCompensation:
    """One whose body stands still though its thrusters were told this torque about x."""
    thrusters, compensation = compensated()
    for _ in range(periods):
        compensation.observe(STILL, thrusters.follow(told(ROLL, torque), H)[3:], H)
    return compensation


def grows(body: Dynamics, axis: int, late: float) -> bool:
    """Whether a body that may be another than control was told turns more and more."""
    thrusters, compensation = compensated()
    integral = command = 0.0

    def control(angle: float, rate: float) -> float:
        nonlocal integral, command
        impulse = thrusters.follow(told(axis, command), H)
        compensation.observe(rate * np.eye(3)[axis - 3], impulse[3:], H)
        ahead = compensation.ahead(turned(axis, angle, rate), rate * np.eye(3)[axis - 3], STILL)
        integral -= PHONE.Ki[axis] * angle * H
        command = integral + float(
            PHONE.Kp[axis] * ahead.e_eta_in_b[axis - 3]
            + PHONE.Kd[axis] * ahead.e_eta_rate_in_b[axis - 3]
        )
        return command

    return one_axis.grows(body, axis, late, control)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "mass", "lag"), [(ROLL, 1.0, 1.0), (YAW, 1.0, 1.0), (ROLL, 0.7, 1.5)]
)
def test_beyond_the_delay_margin_a_simulation_diverges_and_within_it_does_not(
    axis: int, mass: float, lag: float
) -> None:
    nominal = dynamics_of(AMES.robot, AMES.plant)
    body = replace(nominal, inertia=mass * nominal.inertia, lag=lag * nominal.lag)
    config = MarginsConfig(unfelt=0.0)
    loop = Loop(body, PHONE, config, NoFilterConfig(), FeedForwardConfig(), nominal)
    margin = axis_margins(loop, axis, NOTHING).delay
    assert not grows(body, axis, 0.92 * margin)
    assert grows(body, axis, 1.08 * margin)


@pytest.mark.slow
def test_the_lean_of_a_quadrotor_diverges_beyond_its_delay_margin_alone() -> None:
    body, gains = dynamics_of(QUADROTOR.robot, QUADROTOR.plant), QUADROTOR.gains["phone"]
    loop = Loop(body, gains, MarginsConfig(unfelt=0.0), NoFilterConfig(), FeedForwardConfig())
    margin = axis_margins(loop, ROLL, NOTHING).delay

    def grows(late: float) -> bool:
        thrusters = ThrusterModel(QUADROTOR.robot, 6)
        compensation = DelayCompensation(QUADROTOR.robot, thrusters)
        tilt, wrench = TiltToMove(QUADROTOR.robot, gains, TiltConfig()), np.zeros(6)
        up_in_f = QUADROTOR.robot.weight_to_carry * np.eye(3)[2]

        def control(angle: float, rate: float) -> float:
            nonlocal wrench
            R_fb, omega_in_b = exp(np.array([angle, 0.0, 0.0])), np.array([rate, 0.0, 0.0])
            compensation.observe(omega_in_b, thrusters.follow(wrench, H)[3:], H)
            force_in_b = tilt.force_in_b(R_fb.T @ up_in_f, R_fb)
            torque_in_b = tilt.torque_in_b(force_in_b, *compensation.body(omega_in_b))
            wrench = np.array([0.0, 0.0, max(force_in_b[2], 0.0), *torque_in_b, 0.0])
            return float(wrench[ROLL])

        return one_axis.grows(body, ROLL, late, control)

    assert not grows(0.92 * margin)
    assert grows(1.08 * margin)


@pytest.mark.parametrize("axis", [ROLL, YAW])
def test_it_leaves_half_as_much_again_of_the_phase(axis: int) -> None:
    plant, sensing = dynamics_of(AMES.robot, AMES.plant), Sensing("relative", latency=0.09)
    without = Loop(plant, PHONE, MarginsConfig(), NoFilterConfig())
    with_it = replace(without, feedforward=FeedForwardConfig())
    phase, before = (axis_margins(one, axis, sensing).phase for one in (with_it, without))
    assert phase > 1.4 * before


def test_of_what_stands_still_against_a_pull_the_error_is_the_error() -> None:
    ahead = holding(0.3, 400).ahead(turned(ROLL, 0.02, 0.0), STILL, STILL)
    np.testing.assert_allclose(ahead.e_eta_in_b, [-0.02, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(ahead.e_eta_rate_in_b, STILL, atol=1e-5)


def test_a_torque_under_way_is_a_turn_that_will_be() -> None:
    ahead = holding(0.5, 3).ahead(turned(ROLL, 0.0, 0.0), STILL, STILL)
    assert ahead.e_eta_in_b[0] < 0.0
    assert ahead.e_eta_rate_in_b[0] < -0.02
    np.testing.assert_array_equal(ahead.e_p_in_v, STILL)


def test_a_reference_that_turns_faster_and_faster_is_gone_along_with() -> None:
    thrusters, compensation = compensated()
    lead = thrusters.delay_s + thrusters.lag_s
    ahead = compensation.ahead(turned(ROLL, 0.0, 0.0), STILL, np.array([2.0, 0.0, 0.0]))
    np.testing.assert_allclose(ahead.e_eta_rate_in_b, [2.0 * lead, 0.0, 0.0])


@pytest.mark.parametrize("every", [1, 4])
def test_samples_by_the_handful_feel_the_torque_that_turns_a_body(every: int) -> None:
    thrusters, compensation = compensated()
    lead, gains = thrusters.delay_s + thrusters.lag_s, 0.2 / AMES.robot.inertia[0]
    for k in range(80):
        if k % every == 0:
            rate = gains * k * H
        omega = np.array([rate, 0.0, 0.0])
        compensation.observe(omega, thrusters.follow(np.zeros(6), H)[3:], H)
        if k >= 60:
            ahead = compensation.ahead(turned(ROLL, 0.0, rate), omega, STILL)
            assert ahead.e_eta_rate_in_b[0] == pytest.approx(-rate - lead * gains, rel=1e-3)
