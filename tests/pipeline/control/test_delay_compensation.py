"""Delay compensation: as stable as the margins say, and in the way of nothing that stands still."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from pipeline.config import FeedForwardConfig, MarginsConfig
from pipeline.control.delay_compensation import DelayCompensation
from pipeline.control.margins import Loop, Sensing, axis_margins
from pipeline.control.pid import PoseError
from pipeline.control.thruster_model import ThrusterModel
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import Array
from pipeline.gains import PHONE

AMES = load_robot("ames")
H, FINE = 0.005, 0.0005
STILL = np.zeros(3)
ROLL, YAW = 3, 5


def turned(axis: int, angle: float, rate: float) -> PoseError:
    along = np.eye(3)[axis - 3]
    return PoseError(STILL, STILL, -angle * along, -rate * along)


def told(axis: int, torque: float) -> Array:
    wrench: Array = torque * np.eye(6)[axis]
    return wrench


def grows(axis: int, late: float, mass: float = 1.0, lag: float = 1.0) -> bool:
    """Whether a body turned by 0.01 rad turns more and more, by thrusters `late` seconds more.

    Of a body `mass` times as heavy and thrusters `lag` times as slow as control was told.
    """
    plant = dynamics_of(AMES.robot, AMES.plant)
    thrusters = ThrusterModel(AMES.robot, 6)
    compensation = DelayCompensation(AMES.robot, thrusters)
    J, c, k = mass * plant.inertia[axis], plant.damping[axis], plant.stiffness[axis]
    waiting = deque([0.0] * round((late + plant.delay) / FINE))
    angle, rate, torque, integral, command, sizes = 0.01, 0.0, 0.0, 0.0, 0.0, []
    for step in range(round(24.0 / FINE)):
        if step % round(H / FINE) == 0:
            thrusters.follow(told(axis, command), H)
            compensation.observe(rate * np.eye(3)[axis - 3], H)
            ahead = compensation.ahead(turned(axis, angle, rate), STILL)
            integral -= PHONE.Ki[axis] * angle * H
            command = integral + float(
                PHONE.Kp[axis] * ahead.e_eta_in_b[axis - 3]
                + PHONE.Kd[axis] * ahead.e_eta_rate_in_b[axis - 3]
            )
        waiting.append(command)
        torque += FINE / (lag * plant.lag) * (waiting.popleft() - torque)
        rate += FINE * (torque - c * rate - k * angle) / J
        angle += FINE * rate
        sizes.append(abs(angle))
        if sizes[-1] > 1e3:
            return True
    third = len(sizes) // 3
    return max(sizes[-third:]) > max(sizes[third : 2 * third])


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
    margin = axis_margins(loop, axis, Sensing("relative", latency=0.0, body_age=0.0)).delay
    assert not grows(axis, 0.92 * margin, mass, lag)
    assert grows(axis, 1.08 * margin, mass, lag)


@pytest.mark.parametrize("axis", [ROLL, YAW])
def test_it_leaves_half_as_much_again_of_the_phase(axis: int) -> None:
    plant, sensing = dynamics_of(AMES.robot, AMES.plant), Sensing("relative", latency=0.09)
    without = Loop(plant, PHONE, MarginsConfig(), NoFilterConfig())
    with_it = replace(without, feedforward=FeedForwardConfig())
    phase, before = (axis_margins(one, axis, sensing).phase for one in (with_it, without))
    assert phase > 1.4 * before


def test_of_what_stands_still_against_a_pull_the_error_is_the_error() -> None:
    thrusters = ThrusterModel(AMES.robot, 6)
    compensation = DelayCompensation(AMES.robot, thrusters)
    for _ in range(400):
        thrusters.follow(told(ROLL, 0.3), H)
        compensation.observe(STILL, H)
    ahead = compensation.ahead(turned(ROLL, 0.02, 0.0), STILL)
    np.testing.assert_allclose(ahead.e_eta_in_b, [-0.02, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(ahead.e_eta_rate_in_b, STILL, atol=1e-5)


def test_a_torque_under_way_is_a_turn_that_will_be() -> None:
    thrusters = ThrusterModel(AMES.robot, 6)
    compensation = DelayCompensation(AMES.robot, thrusters)
    for _ in range(3):
        thrusters.follow(told(ROLL, 0.5), H)
        compensation.observe(STILL, H)
    ahead = compensation.ahead(turned(ROLL, 0.0, 0.0), STILL)
    assert ahead.e_eta_in_b[0] < 0.0
    assert ahead.e_eta_rate_in_b[0] < -0.02
    np.testing.assert_array_equal(ahead.e_p_in_v, STILL)


def test_a_reference_that_turns_faster_and_faster_is_gone_along_with() -> None:
    thrusters = ThrusterModel(AMES.robot, 6)
    compensation = DelayCompensation(AMES.robot, thrusters)
    lead = thrusters.delay_s + thrusters.lag_s
    ahead = compensation.ahead(turned(ROLL, 0.0, 0.0), np.array([2.0, 0.0, 0.0]))
    np.testing.assert_allclose(ahead.e_eta_rate_in_b, [2.0 * lead, 0.0, 0.0])
