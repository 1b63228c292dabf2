"""The robot file's physics as six one-axis systems, for feed-forward and stability margins."""

from __future__ import annotations

import numpy as np

from hardware.plant_parameters import PlantParameters
from pipeline.control.dynamics import Dynamics
from pipeline.frames import GRAVITY
from pipeline.robot import Robot


def dynamics_of(robot: Robot, plant: PlantParameters) -> Dynamics:
    """Small motions about rest, each axis by itself.

    The cable is a spring along z, a pendulum along x and y (attitude held), and its hook above the
    centre of mass rights roll and pitch (place held).
    """
    stiffness, damping = np.zeros(6), np.repeat((plant.air_damping, plant.air_damping_rotation), 3)
    if plant.suspension is not None:
        cable = plant.suspension
        weight, hook = plant.mass * GRAVITY, cable.hook_above_com
        righting = weight * hook * (1.0 + hook / cable.length)
        stiffness[:2], stiffness[2] = weight / cable.length, cable.stiffness
        stiffness[3:5] = righting
        damping[2] += cable.damping
    return Dynamics(
        inertia=np.concatenate((np.full(3, plant.mass), plant.inertia)),
        damping=damping,
        stiffness=stiffness,
        lag=plant.lag,
        delay=plant.delay,
        needs_tilt=robot.needs_tilt,
    )
