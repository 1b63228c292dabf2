"""Exchanged and reversed thrusters and turned sensors are told by what they do, and told apart."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.robot_schema import R_from_axes, axes_from_R
from hardware.sim.plant.built import AsBuilt
from hardware.system_identification.imu_attitude import attitude_by_imu
from hardware.system_identification.thruster_sorting import TURNS, Felt, felt_of, sort
from tests.hardware.system_identification.pulses import pulsed

KNOWN = load_robot("ames").plant
SHAKES = {"hz": 63.0, "rate_rad_s": 0.02, "force_m_s2": 0.5}
SWAPPED = [1, 4, 3, 2, 5, 6, 7, 8]
HEAVY = {"mass_kg": 4.4, "inertia_kg_m2": [0.034, 0.066, 0.07], "lag_s": 0.044}
GAINS = [0.86, 1.14, 1.1, 0.9, 1.0, 1.12, 0.88, 0.97]


def sorted_by(known, level, said, seed=1):
    built = AsBuilt.model_validate({"vibration": SHAKES, **said})
    gains = built.thrust_gains(len(known.thruster_torques))
    commands, omega, force, _ = pulsed(built.plant(known), level, built.options(), seed, gains)
    seen = attitude_by_imu(omega, force, known.imu)
    return sort(known, felt_of(commands, seen, known.delay), force[:300].mean(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("odd", [{}, {**HEAVY, "gains": GAINS}])
@pytest.mark.parametrize(
    ("said", "swapped", "backward", "silent", "is_turned"),
    [
        ({}, (), (), (), False),
        ({"order": SWAPPED}, (1, 3), (), (), False),
        ({"backward": [{"thruster": 3}]}, (), (2,), (), False),
        ({"backward": [{"thruster": 8, "why": "propeller"}]}, (), (7,), (), False),
        ({"order": SWAPPED, "backward": [{"thruster": 4}]}, (1, 3), (3,), (), False),
        ({"backward": [{"thruster": 5, "gives": 0.0}]}, (), (), (4,), False),
        # the AMES turned by half a turn about z is the AMES with all its thrusters exchanged
        ({"imu_axes": ["-x", "-y", "z"]}, (), (), (), True),
        ({"imu_axes": ["y", "-x", "z"], "order": SWAPPED}, (1, 3), (), (), True),
        ({"imu_axes": ["z", "-y", "x"]}, (), (), (), True),
    ],
)
def test_what_is_built_wrongly_is_named_and_nothing_else(
    said, swapped, backward, silent, is_turned, odd
):
    found = sorted_by(KNOWN, 0.3, {**odd, **said})
    assert (found.swapped, found.reversed, found.silent) == (swapped, backward, silent)
    assert found.is_turned == is_turned
    assert not found.is_ambiguous
    assert found.unclear == ()
    assert found.is_as_told == (said == {})


@cache
def told():
    """What the file's own thrusters would be felt by."""
    columns = np.vstack((KNOWN.thruster_directions_in_b.T, np.zeros((3, 8))))
    columns[3:] = (
        np.cross(KNOWN.thruster_positions_in_b, KNOWN.thruster_directions_in_b).T
        + KNOWN.thruster_torques * KNOWN.thruster_directions_in_b.T
    )
    return [Felt(c[:3] / KNOWN.mass, c[3:] / KNOWN.inertia) for c in columns.T]


def test_a_thruster_like_none_of_the_file_s_is_called_so():
    felt = list(told())
    felt[2] = Felt(np.array((0.3, 0.0, 0.0)), np.zeros(3))
    assert sort(KNOWN, felt, np.array((0.0, 0.0, 9.8))).unclear == (2,)


def test_sensors_that_explain_nothing_upright_leave_all_unclear():
    slanted = sort(KNOWN, told(), np.array((5.7, 5.7, 5.7)))
    assert slanted.is_ambiguous
    assert len(slanted.unclear) == 8


@pytest.mark.parametrize("robot", ["ames", "ground"])
def test_who_is_built_by_the_file_gets_its_own_thrusters_back(robot):
    known = load_robot(robot).plant
    felt = [
        Felt(
            direction / known.mass,
            (np.cross(place, direction) + torque * direction) / known.inertia,
        )
        for place, direction, torque in zip(
            known.thruster_positions_in_b,
            known.thruster_directions_in_b,
            known.thruster_torques,
            strict=True,
        )
    ]
    found = sort(known, felt, np.array((0.0, 0.0, 9.8)))
    assert found.is_as_told
    for mine, theirs in zip(found.built(known), (known.thruster_positions_in_b,), strict=False):
        np.testing.assert_array_equal(mine, theirs)


def test_there_are_24_turns_by_right_angles_and_a_robot_file_can_say_each() -> None:
    assert len(TURNS) == len(np.unique(TURNS, axis=0)) == 24
    for R_bs in TURNS:
        np.testing.assert_array_equal(R_from_axes(axes_from_R(R_bs)), R_bs)
        assert np.linalg.det(R_bs) == pytest.approx(1.0)
