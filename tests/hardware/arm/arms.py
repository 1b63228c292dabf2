"""The arm that ships, for tests."""

from __future__ import annotations

import numpy as np

from hardware.arm.arm_model import ArmModel
from hardware.robot_file import COMMANDS, load_robot
from pipeline.frames import Array

SO101 = load_robot("so101", takes=COMMANDS)
PARAMETERS = SO101.plant.arm
assert PARAMETERS is not None
ARM = ArmModel(PARAMETERS)
HOME = PARAMETERS.home
AXES = SO101.robot.axes
H_S = 0.005


def postures(seed: int, many: int) -> Array:
    """(many, n) [rad], anywhere in the joints' ranges."""
    return np.random.default_rng(seed).uniform(ARM.low, ARM.high, (many, len(HOME)))
