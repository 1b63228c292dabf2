"""The robot file's physics as six one-axis systems, for feed-forward and stability margins."""

from __future__ import annotations

import numpy as np

from hardware.plant_parameters import PlantParameters
from pipeline.control.dynamics import Dynamics
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
    )
