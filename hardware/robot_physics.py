"""Physical conditions that a robot must meet to be flown."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import lsq_linear, nnls

from hardware.plant_parameters import PlantParameters, StandParameters, SuspensionParameters
from hardware.robot_schema import AXES
from pipeline.frames import Array
from pipeline.robot import Robot

LEAST_LED_SPREAD_M = 0.03
"""RMS distance of the LEDs from the plane that fits them best: flatter, a picture has two poses."""
LEAST_LED_SPREAD = 0.12
"""The same, of their RMS distance from their middle: enough for a small robot, which is led from
nearby."""
LEAST_LED_DISTANCE_M = 0.02
LARGEST_ROBOT_M = 3.0
"""Anything farther from the centre of mass is a slip of the decimal point."""
LEAST_SINGULAR_VALUE = 1e-2
"""Of A with torques divided by the thrusters' mean distance."""
MOST_TO_HOVER = 0.85
"""Share of a thruster's force that carrying the weight may take; the rest is to steer with."""


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
    """Faults of a robot: (key of the robot file, what would be allowed)."""
    Ixx, Iyy, Izz = plant.inertia
    if max(Ixx, Iyy, Izz) > 0.5 * (Ixx + Iyy + Izz):
        yield "body.inertia_kg_m2", "no moment larger than the sum of the two others"
    if plant.suspension is not None:
        yield from _suspension_faults(plant.suspension, plant.mass)
    if plant.stand is not None:
        yield from _stand_faults(plant.stand)
    if robot.f_min >= robot.f_max:
        yield "thrusters.f_min_n", "below f_max_n"
    yield from _thruster_faults(plant)
    yield from _axes_faults(robot)
    if robot.attitude is not None and not robot.needs_tilt:
        yield "link.takes", "'thrusts': with 'attitude' all thrusters push along b's z axis"
    yield from _wrench_faults(robot, plant)
    yield from led_faults(robot.leds_in_b)


def _suspension_faults(suspension: SuspensionParameters, mass: float) -> Iterator[tuple[str, str]]:
    if suspension.rest_length(mass) <= 0.0:
        least = mass * 9.81 / suspension.length
        yield "suspension.stiffness_n_m", f"above {least:.3g}: the cable must not begin below 0 m"


def _stand_faults(stand: StandParameters) -> Iterator[tuple[str, str]]:
    """Feet on one level below the centre of mass, and it between them."""
    feet = stand.feet_in_b
    if np.ptp(feet[:, 2]) > 1e-3 or feet[:, 2].max() > 0.0:
        yield "stand.feet_in_body_m", "all at one height below the centre of mass"
    elif np.abs(feet).max() > LARGEST_ROBOT_M:
        yield "stand.feet_in_body_m", f"within {LARGEST_ROBOT_M:g} m of the centre of mass"
    elif positive_null_vector(feet[:, :2].T) is None:
        yield "stand.feet_in_body_m", "around the centre of mass, or it tips over"


def _axes_faults(robot: Robot) -> Iterator[tuple[str, str]]:
    """Thrusters along one axis must be turned where they shall push."""
    if not robot.needs_tilt:
        return
    directions = robot.A[:3] / np.linalg.norm(robot.A[:3], axis=0)
    if robot.axes[3:5].any():
        yield "axes", "x, y, z, yaw: thrusters along one axis go sideways by roll and pitch"
    elif robot.hangs or not robot.axes[2]:
        yield "axes", "with z, and no [suspension]: it tilts the force that carries it"
    elif not np.allclose(directions, np.eye(3)[:, 2:], atol=1e-2):
        yield "thrusters.units", "all with direction_in_body = [0.0, 0.0, 1.0], or along three axes"


def _thruster_faults(plant: PlantParameters) -> Iterator[tuple[str, str]]:
    units = zip(plant.thruster_positions_in_b, plant.thruster_directions_in_b, strict=True)
    for i, (position, direction) in enumerate(units):
        if np.linalg.norm(position) > LARGEST_ROBOT_M:
            key = f"thrusters.units.{i}.position_in_body_m"
            yield key, f"within {LARGEST_ROBOT_M:g} m of the centre of mass"
        if abs(np.linalg.norm(direction) - 1.0) > 1e-3:
            yield f"thrusters.units.{i}.direction_in_body", "a vector of length 1"


def _wrench_faults(robot: Robot, plant: PlantParameters) -> Iterator[tuple[str, str]]:
    """Any small wrench on the controlled axes must be possible with thrusts that are positive."""
    rows = robot.wrench_axes
    words = ", ".join(axis for axis, row in zip(AXES, rows, strict=True) if row)
    arm = max(float(np.linalg.norm(plant.thruster_positions_in_b, axis=1).mean()), 1e-6)
    scaled = (robot.A / np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None])[rows]
    least = len(scaled) + (robot.weight_to_carry == 0.0)
    if scaled.shape[1] < least:
        yield "thrusters.units", f"at least {least} to push both ways on {words}"
    elif np.linalg.svd(scaled, compute_uv=False)[-1] < LEAST_SINGULAR_VALUE:
        yield "thrusters.units", f"positions and directions that give forces and torques on {words}"
    elif robot.weight_to_carry > 0.0:
        yield from _hover_faults(robot, scaled)
    elif positive_null_vector(scaled) is None:
        yield "thrusters.units", "an arrangement in which some all-positive thrusts cancel"


def _hover_faults(robot: Robot, scaled: Array) -> Iterator[tuple[str, str]]:
    """Faults of hovering: weight carried, without turning, by thrusts with room either way."""
    weight = np.array([0.0, 0.0, robot.weight_to_carry, 0.0, 0.0, 0.0])[robot.wrench_axes]
    bounds = (1.05 * robot.f_min, max(MOST_TO_HOVER * robot.f_max, 1.06 * robot.f_min + 1e-9))
    short = float(np.abs(lsq_linear(scaled, weight, bounds).fun).max())
    if short > 1e-3 * robot.weight_to_carry:
        yield (
            "thrusters.f_max_n",
            f"such that thrusts from f_min_n to {100 * MOST_TO_HOVER:.0f} % of it carry the weight"
            f" of {robot.weight_to_carry:.1f} N without turning it ({short:.1f} N missing)",
        )


def positive_null_vector(A: Array) -> Array | None:
    """Thrusts (m,), each at least 1, with A n = 0; None if there are none.

    With such an n and full rank, thrusters that only push can give any wrench.
    """
    ones = np.ones(A.shape[1])
    excess, residual = nnls(A, -(A @ ones))
    return ones + excess if residual < 1e-4 else None


def led_faults(leds_in_b: Array) -> Iterator[tuple[str, str]]:
    """Faults of LEDs (n, 3) [m]: (key of the robot file, what would be allowed)."""
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
    spreads = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(leds_in_b))
    spread, size = float(spreads[-1]), float(np.sqrt(spreads @ spreads))
    least = min(LEAST_LED_SPREAD_M, LEAST_LED_SPREAD * size)
    if spread < least:
        yield "leds", f"not in one plane: {least:.2g} m RMS from it, not {spread:.3g} m"
