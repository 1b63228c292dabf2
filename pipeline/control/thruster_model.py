"""Thrusters that begin a time after their command, and follow it by a lag of first order."""

from __future__ import annotations

import numpy as np

from pipeline.control.thruster_model_kernels import follow
from pipeline.frames import Array
from pipeline.robot import Robot

KEPT = 64
"""Commands: 0.3 s at 200 Hz, longer than any thruster's delay."""
LEAST_LAG_S = 1e-4
"""Of one without any."""


class ThrusterModel:
    """What thrusters give, and will give by what they are told already. Call `follow` each period.

    Of each thruster's thrust (k,) [N], or of their wrench (6,) [N, N m]: its force in f, for it
    keeps its direction while the body turns meanwhile, and its torque in b.
    """

    def __init__(self, robot: Robot, size: int) -> None:
        """Off for long; of so many numbers."""
        self.lag_s, self.delay_s = max(robot.thrust_lag_s, LEAST_LAG_S), robot.thrust_delay_s
        self._told, self._lasted = np.zeros((KEPT, size)), np.full(KEPT, self.delay_s)
        self.given: Array = np.zeros(size)
        """Now."""
        self.follow(self.given, 0.0)  # compiles or loads the kernel here: never inside the loop

    def follow(self, told: Array, h: float) -> Array:
        """Go on by `h` [s], since the beginning of which they are `told` this.

        Returns:
            (k,) what they have given meanwhile, over time.
        """
        self._told[1:], self._lasted[1:] = self._told[:-1], self._lasted[:-1]
        self._told[0], self._lasted[0] = told, h
        impulse, _ = self._carry_on(self.delay_s + h, self.delay_s, self.given)
        return impulse

    def ahead(self) -> tuple[Array, Array, Array]:
        """What they give when what is decided now begins (k,), and its integrals from now on.

        (k,) each: of it over time, and of that.
        """
        given = self.given.copy()
        return given, *self._carry_on(self.delay_s, 0.0, given)

    def _carry_on(self, older: float, younger: float, given: Array) -> tuple[Array, Array]:
        once, twice = np.zeros_like(given), np.zeros_like(given)
        follow(self._told, self._lasted, older, younger, self.lag_s, given, once, twice)
        return once, twice
