"""What a robot must be like to be flown at all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import nnls

from hardware.sim.parameters import PlantParameters
from pipeline.frames import Array
from pipeline.robot import Robot

LEAST_LED_SPREAD_M = 0.03
"""RMS distance of the LEDs from the plane that fits them best: flatter, a picture has two poses."""
LEAST_LED_DISTANCE_M = 0.02
LARGEST_ROBOT_M = 3.0
"""Anything farther from the centre of mass is a slip of the decimal point."""
LEAST_SINGULAR_VALUE = 1e-2
"""Of A with torques divided by the thrusters' mean distance."""


def allocation_matrix(positions_in_b: Array, directions_in_b: Array, torques: Array) -> Array:
    """Wrench in b per thrust, (6, m). The paper's [26], [6].

    Args:
        positions_in_b: (m, 3) [m] from the centre of mass.
        directions_in_b: (m, 3) unit vectors of the forces.
        torques: (m,) reaction torque along the direction per thrust [m], signed.
    """
    moments = np.cross(positions_in_b, directions_in_b) + torques[:, None] * directions_in_b
    return np.vstack((directions_in_b.T, moments.T))


def faults(robot: Robot, plant: PlantParameters) -> Iterator[tuple[str, str]]:
    """What is wrong with a robot: (key of the robot file, what would be allowed)."""
    Ixx, Iyy, Izz = plant.inertia
    if max(Ixx, Iyy, Izz) > 0.5 * (Ixx + Iyy + Izz):
        yield "body.inertia_kg_m2", "no moment larger than the sum of the two others"
    if plant.cable_rest_length <= 0.0:
        least = plant.mass * 9.81 / plant.cable_length
        yield "suspension.stiffness_n_m", f"above {least:.3g}: the cable must not begin below 0 m"
    if robot.f_min >= robot.f_max:
        yield "thrusters.f_min_n", "below f_max_n"
    yield from _thruster_faults(plant)
    yield from _wrench_faults(robot.A, plant)
    yield from _led_faults(robot.leds_in_b)


def _thruster_faults(plant: PlantParameters) -> Iterator[tuple[str, str]]:
    units = zip(plant.thruster_positions_in_b, plant.thruster_directions_in_b, strict=True)
    for i, (position, direction) in enumerate(units):
        if np.linalg.norm(position) > LARGEST_ROBOT_M:
            key = f"thrusters.units.{i}.position_in_body_m"
            yield key, f"within {LARGEST_ROBOT_M:g} m of the centre of mass"
        if abs(np.linalg.norm(direction) - 1.0) > 1e-3:
            yield f"thrusters.units.{i}.direction_in_body", "a vector of length 1"


def _wrench_faults(A: Array, plant: PlantParameters) -> Iterator[tuple[str, str]]:
    """Any wrench must be possible with thrusts that are all positive."""
    arm = max(float(np.linalg.norm(plant.thruster_positions_in_b, axis=1).mean()), 1e-6)
    scaled = A / np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    if np.linalg.svd(scaled, compute_uv=False)[-1] < LEAST_SINGULAR_VALUE:
        yield "thrusters.units", "positions and directions that give force and torque on all axes"
    elif positive_null_vector(scaled) is None:
        yield "thrusters.units", "an arrangement in which some all-positive thrusts cancel"


def positive_null_vector(A: Array) -> Array | None:
    """Thrusts (m,), each at least 1, with A n = 0; None if there are none.

    With such an n and full rank, thrusters that only push can give any wrench.
    """
    ones = np.ones(A.shape[1])
    excess, residual = nnls(A, -(A @ ones))
    return ones + excess if residual < 1e-4 else None


def _led_faults(leds_in_b: Array) -> Iterator[tuple[str, str]]:
    distances = np.linalg.norm(leds_in_b, axis=1)
    if (distances > LARGEST_ROBOT_M).any():
        yield (
            f"leds.{int(distances.argmax())}.position_in_body_m",
            f"within {LARGEST_ROBOT_M:g} m of the centre of mass",
        )
    for i, led in enumerate(leds_in_b):
        if (np.linalg.norm(leds_in_b[:i] - led, axis=1) < LEAST_LED_DISTANCE_M).any():
            yield f"leds.{i}.position_in_body_m", f"{LEAST_LED_DISTANCE_M:g} m from the others"
    centred = leds_in_b - leds_in_b.mean(axis=0)
    spread = float(np.linalg.svd(centred, compute_uv=False)[-1]) / np.sqrt(len(leds_in_b))
    if spread < LEAST_LED_SPREAD_M:
        yield "leds", f"not in one plane: {LEAST_LED_SPREAD_M:g} m RMS from it, not {spread:.3g} m"
