"""One-axis dynamics against the simulated robot: the same stiffness, damping and inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from hardware.sim.plant.plant import Plant

AMES = load_robot("ames")


def push(wrench_in_f: np.ndarray, seconds: float, **changes: float) -> Plant:
    """The AMES under a lasting wrench, from rest, thrusters off."""
    plant = Plant(replace(AMES.plant, **changes), np.random.default_rng(0))
    plant.external_wrench_in_f[:] = wrench_in_f
    plant.step(np.zeros(8), seconds)
    return plant


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_steady_force_moves_it_by_force_over_stiffness(axis: int) -> None:
    dynamics = dynamics_of(AMES.robot, AMES.plant)
    force = 0.5 * np.eye(6)[axis]
    moved = push(force, 12.0, air_damping=6.0, air_damping_rotation=0.4).p_bf_in_f
    # the hook is above the centre of mass, so the body leans a little: 2 % of the length
    assert moved[axis] == pytest.approx(0.5 / dynamics.stiffness[axis], rel=0.04)


def test_a_steady_torque_turns_it_by_torque_over_stiffness() -> None:
    dynamics = dynamics_of(AMES.robot, AMES.plant)
    plant = push(0.02 * np.eye(6)[3], 12.0, air_damping=6.0, air_damping_rotation=0.4)
    roll = np.arcsin(plant.R_fb[2, 1])
    assert roll == pytest.approx(0.02 / dynamics.stiffness[3], rel=0.05)


@pytest.mark.parametrize("axis", range(6))
def test_a_kick_is_met_by_the_inertia(axis: int) -> None:
    dynamics = dynamics_of(AMES.robot, AMES.plant)
    plant = push(np.eye(6)[axis], 0.005)
    reached = np.concatenate((plant.v_bf_in_f, plant.omega_bf_in_b))[axis]
    assert reached == pytest.approx(0.005 / dynamics.inertia[axis], rel=0.02)


def test_what_does_not_hang_has_no_stiffness_and_a_quadrotor_tilts() -> None:
    for name, tilts in (("quadrotor", True), ("ground", False)):
        robot_file = load_robot(name)
        dynamics = dynamics_of(robot_file.robot, robot_file.plant)
        assert not dynamics.stiffness.any()
        assert dynamics.needs_tilt is tilts
