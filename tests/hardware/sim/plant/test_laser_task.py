"""The beam through the tube: geometry that MuJoCo's own rays confirm."""

from __future__ import annotations

from math import cos, inf, radians, sin

import mujoco
import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.laser_task import SIDES, Beam, Laser, Tube
from hardware.sim.plant.plant import Plant, PlantOptions
from pipeline.frames import UP, R_between, exp

TILT = radians(15.0)
AXIS = np.array([0.0, -sin(TILT), cos(TILT)])
TUBE = Tube(np.array([0.1, -0.2, -0.5]), AXIS, length=0.2, radius=0.015)
SIDE = np.array([1.0, 0.0, 0.0])
"""Square to the axis."""


def beam_through(upper: np.ndarray, lower: np.ndarray) -> Beam:
    """From 0.3 m above the tube, with these offsets (3,) from the axis at its ends."""
    top = TUBE.centre_in_f + 0.1 * AXIS + upper
    bottom = TUBE.centre_in_f - 0.1 * AXIS + lower
    direction = (bottom - top) / np.linalg.norm(bottom - top)
    return top - 0.3 * direction, direction


def passes(beam: Beam) -> bool:
    """Enters by one end and leaves by the other."""
    return TUBE.clearance(beam) >= 0.0


def reach(plant: Plant, beam: Beam) -> float:
    """How far it goes until it meets something [m]; inf: nothing."""
    origin, direction = beam
    met = float(mujoco.mj_ray(plant._model, plant._data, origin, direction, None, 1, -1, None))
    return met if met >= 0.0 else inf


@pytest.mark.parametrize(
    ("upper", "lower", "inside"),
    [
        (0.0, 0.0, True),
        (0.0149, 0.0149, True),
        (0.0149, -0.0149, True),
        (0.0151, 0.0, False),
        (0.0, 0.0151, False),
        (0.0151, 0.0151, False),
        (0.05, -0.05, False),
    ],
)
def test_a_beam_passes_that_is_in_the_bore_at_both_ends(
    upper: float, lower: float, inside: bool
) -> None:
    beam = beam_through(upper * SIDE, lower * SIDE)
    assert passes(beam) is inside
    assert TUBE.clearance(beam) == pytest.approx(0.015 - max(abs(upper), abs(lower)))


def test_a_beam_that_points_away_or_beside_does_not_pass() -> None:
    origin, direction = beam_through(np.zeros(3), np.zeros(3))
    assert not passes((origin, -direction))
    assert TUBE.clearance((origin, SIDE)) == -inf
    assert not passes((TUBE.centre_in_f, direction))  # begins inside: enters by no end


def test_the_beam_turns_and_moves_with_the_robot() -> None:
    laser = Laser(np.array([0.0, 0.0, -0.2]), -UP)
    place = np.array([1.0, 2.0, 3.0])
    origin, direction = laser.beam(R_between(UP, AXIS), place)
    assert origin == pytest.approx(place - 0.2 * AXIS)
    assert direction == pytest.approx(-AXIS)


def test_mujocos_rays_meet_no_wall_where_the_beam_passes_and_one_where_it_leaves_the_bore() -> None:
    plant = Plant(load_robot("ames").plant, np.random.default_rng(0), PlantOptions(tube=TUBE))
    rng = np.random.default_rng(1)
    corner = TUBE.radius / cos(np.pi / SIDES)
    passed = met = 0
    for _ in range(2000):
        phi, psi = rng.uniform(0.0, 2.0 * np.pi, 2)
        upper = 0.015 * np.sqrt(rng.uniform()) * exp(phi * AXIS) @ SIDE
        lower = rng.uniform(0.0, 0.04) * exp(psi * AXIS) @ SIDE
        beam = beam_through(upper, lower)
        if passes(beam):
            passed += 1
            assert reach(plant, beam) == inf
        elif float(np.linalg.norm(lower)) > corner:
            met += 1
            assert 0.3 < reach(plant, beam) < 0.55
    assert passed > 300
    assert met > 300


def test_a_beam_on_the_rim_is_stopped_where_the_tube_begins() -> None:
    plant = Plant(load_robot("ames").plant, np.random.default_rng(0), PlantOptions(tube=TUBE))
    beam = beam_through(0.0165 * SIDE, 0.0165 * SIDE)
    assert not passes(beam)
    assert reach(plant, beam) == pytest.approx(0.3, abs=1e-6)


def test_the_tube_is_there_only_if_asked_for_and_the_robot_does_not_feel_it() -> None:
    parameters = load_robot("quadrotor").plant  # one that can touch things
    here = Tube(np.zeros(3), AXIS, 0.2, 0.015)
    rng = np.random.default_rng
    bare, beside = Plant(parameters, rng(0)), Plant(parameters, rng(0), PlantOptions(tube=here))
    for plant in (bare, beside):
        plant.step(np.zeros(len(parameters.thruster_torques)), 0.5)
    assert np.array_equal(bare.p_bf_in_f, beside.p_bf_in_f)
    across = (np.array([-1.0, 0.0, 0.0]), SIDE)
    assert reach(beside, across) < 1.0
    hanging = Plant(load_robot("ames").plant, rng(0))
    assert reach(hanging, across) == inf
