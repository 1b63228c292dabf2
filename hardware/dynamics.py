"""The robot file's physics as six one-axis systems, for feed-forward and stability margins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hardware.plant_parameters import PlantParameters
from pipeline.control.dynamics import Dynamics
from pipeline.control.uncertainty import (
    ASSUMED_LAG,
    ASSUMED_MASS,
    LAG_SINCE,
    MASS_SINCE,
    Factors,
    Uncertainty,
)
from pipeline.frames import GRAVITY, Array
from pipeline.robot import Robot


def restoring_in_f(plant: PlantParameters) -> tuple[Array, Array]:
    """Stiffness [N/m] and damping [N s/m] (3,) each, of small motions about rest, attitude held.

    The cable is a spring along z, a pendulum along x and y; without one nothing restores.
    """
    stiffness, damping = np.zeros(3), np.full(3, plant.air_damping)
    if plant.suspension is not None:
        stiffness[:2] = plant.mass * GRAVITY / plant.suspension.length
        stiffness[2] = plant.suspension.stiffness
        damping[2] += plant.suspension.damping
    return stiffness, damping


def dynamics_of(robot: Robot, plant: PlantParameters) -> Dynamics:
    """Small motions about rest, each axis by itself.

    The hook above the centre of mass rights roll and pitch (place held).
    """
    stiffness, damping = np.zeros(6), np.full(6, plant.air_damping_rotation)
    stiffness[:3], damping[:3] = restoring_in_f(plant)
    if plant.suspension is not None:
        cable = plant.suspension
        hook = cable.hook_above_com
        stiffness[3:5] = plant.mass * GRAVITY * hook * (1.0 + hook / cable.length)
    return Dynamics(
        inertia=np.concatenate((np.full(3, plant.mass), plant.inertia)),
        damping=damping,
        stiffness=stiffness,
        lag=plant.lag,
        delay=plant.delay,
        needs_tilt=robot.needs_tilt,
        attitude=robot.attitude,
        uncertainty=uncertainty_of(plant),
    )


def uncertainty_of(plant: PlantParameters) -> Uncertainty:
    """Which bodies the robot may be, by the intervals of what was identified."""
    told, cable = plant.intervals, plant.suspension
    roll, pitch, yaw = (
        _inertia(half, value)
        for half, value in zip(told.inertia, plant.inertia.tolist(), strict=True)
    )
    lag, delay = ASSUMED_LAG, 0.0
    if told.lag is not None and told.delay is not None:
        lag, delay = replace(LAG_SINCE, interval=told.lag / plant.lag), told.delay
    stiffness, damping = np.zeros(6), np.full(6, told.air_damping_rotation or 0.0)
    damping[:3] = told.air_damping or 0.0
    if cable is not None:
        weight, hook = plant.mass * GRAVITY, told.hook_above_com or 0.0
        stiffness[:2] = weight / cable.length * (told.length or 0.0) / cable.length
        stiffness[2] = told.stiffness or 0.0
        stiffness[3:5] = weight * hook * (1.0 + (2.0 * cable.hook_above_com + hook) / cable.length)
        damping[2] += told.damping or 0.0
    return Uncertainty(
        mass=_inertia(told.mass, plant.mass),
        moments=(roll, pitch, yaw),
        lag=lag,
        delay=delay,
        stiffness=tuple(stiffness.tolist()),
        damping=tuple(damping.tolist()),
    )


def _inertia(half: float | None, value: float) -> Factors:
    return ASSUMED_MASS if half is None else replace(MASS_SINCE, interval=half / value)
