"""Reach: what the faces say is what a linear program finds, and the allocation can give it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from hardware.robot_file import load_robot
from pipeline.control.allocation import Allocation
from pipeline.control.reach import ORDER, ThrustReach
from pipeline.frames import Array

AMES = load_robot("ames").robot
KEPT_N = 0.3
AWAY = np.random.default_rng(5).normal(size=(40, 3))


def most_n(direction: Array, kept_n: float = KEPT_N) -> float:
    """The largest force along a unit vector at no torque, by a linear program over the thrusts."""
    thrusters = AMES.A.shape[1]
    along = np.concatenate((direction, np.zeros(3)))
    found = linprog(
        np.append(np.zeros(thrusters), -1.0),
        A_eq=np.hstack((AMES.A, -along[:, None])),
        b_eq=np.zeros(6),
        bounds=[(AMES.f_min, AMES.f_max - kept_n)] * thrusters + [(0.0, None)],
    )
    return float(found.x[-1])


def test_the_reach_ends_where_a_linear_program_over_the_thrusts_ends() -> None:
    reach = ThrustReach(AMES, KEPT_N)
    for away in np.vstack((np.eye(3), -np.eye(3), AWAY)):
        direction = away / np.linalg.norm(away)
        taken, _ = reach.taken(most_n(direction) * direction)
        assert 1.0 - 1e-4 < taken < 8.0 ** (1.0 / ORDER)


def test_what_takes_up_all_of_it_leaves_each_thruster_what_is_kept() -> None:
    """The least thrusts for a force on the border are no larger than those that show it exists."""
    reach, allocation = ThrustReach(AMES, KEPT_N), Allocation(AMES)
    for away in AWAY:
        force_in_b = away / reach.taken(away)[0]
        thrusts = allocation.thrusts(np.concatenate((force_in_b, np.zeros(3))))
        np.testing.assert_allclose(AMES.A @ thrusts, [*force_in_b, 0.0, 0.0, 0.0], atol=1e-4)
        assert thrusts.max() < AMES.f_max - 0.5 * KEPT_N


def test_twice_the_force_takes_up_twice_as_much() -> None:
    reach = ThrustReach(AMES, KEPT_N)
    for away in AWAY:
        assert reach.taken(2.0 * away)[0] == pytest.approx(2.0 * reach.taken(away)[0])
    assert reach.taken(np.zeros(3)) == (0.0, pytest.approx(np.zeros(3)))


def test_its_gradient_is_what_differences_say() -> None:
    reach, step_n = ThrustReach(AMES, KEPT_N), 1e-6
    for away in AWAY:
        ahead = [reach.taken(away + step_n * axis)[0] for axis in np.eye(3)]
        behind = [reach.taken(away - step_n * axis)[0] for axis in np.eye(3)]
        differences = (np.array(ahead) - behind) / (2.0 * step_n)
        np.testing.assert_allclose(reach.taken(away)[1], differences, atol=1e-6)


def test_thrusters_that_can_hold_it_nowhere_are_refused() -> None:
    with pytest.raises(ValueError, match=r"'ames'.*no reach"):
        ThrustReach(AMES, AMES.f_max)
    one_way = np.array([[1.0], [1.0], [1.0], [0.0], [0.0], [0.0]])
    with pytest.raises(ValueError, match="no reach"):
        ThrustReach(replace(AMES, A=np.hstack((np.eye(6), one_way))), KEPT_N)
