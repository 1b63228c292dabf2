"""What the thrusters of a robot are taken to give that is told a thrust along its body's z axis."""

from __future__ import annotations

import numpy as np

from hardware.follower import LIFT
from pipeline.frames import Array
from pipeline.robot import Robot, lift_mixer


class PresumedThrusts:
    """Shares a thrust out as level flight does; a robot that says no more of them."""

    def __init__(self, robot: Robot) -> None:
        """Of a robot that takes attitude and thrust: told nothing."""
        self._each, self._f_max = lift_mixer(robot.A)[:, 0], robot.f_max
        self._lift = 0.0

    def tell(self, told: Array, _now: float) -> None:
        """It is told this attitude and thrust (4,)."""
        self._lift = float(told[LIFT][0])

    def at(self, _now: float) -> Array:
        """Thrusts (m,) [N]."""
        return np.clip(self._each * self._lift, 0.0, self._f_max)
