"""How an arm's tip moves now, by its joints: what servos were told, and encoders' angles.

Encoders tell angles in steps and no rates: differences of them are late or rough. But it is known
what rates servos were told and how they lag. An observer of each joint goes on by that, and by what
its encoder tells that it moves beside: so its rates are those of now, and right in contact, too.
"""

from __future__ import annotations

from math import exp as exponential
from typing import Final

import numpy as np

from hardware.arm.arm_model import ArmModel
from pipeline.frames import Array

BACK_RAD_S: Final = 20.0
"""Both of its poles: a motion that nobody told is known 0.1 s later, and steps of 360°/4096 make
a noise of 3 mrad/s."""


class TipOdometry:
    """Of one arm whose servos lag by `lag_s` [s]."""

    def __init__(self, arm: ArmModel, lag_s: float, measured: Array) -> None:
        """At rest, at angles (n,) [rad]."""
        self._arm, self._lag_s = arm, lag_s
        self._q = measured
        self._lagging = self._beside = np.zeros(len(measured))

    def step(self, told_rates: Array, measured: Array, h: float) -> None:
        """For `h` [s] servos were told rates (n,) [rad/s]; now these angles are measured."""
        before = self._lagging
        self._lagging = told_rates + exponential(-h / self._lag_s) * (before - told_rates)
        q = self._q + h * (0.5 * (before + self._lagging) + self._beside)
        stays, off = exponential(-h * BACK_RAD_S), measured - q
        self._q = q + (1.0 - stays * stays) * off
        self._beside = self._beside + (1.0 - stays) ** 2 / h * off

    @property
    def twist_in_b(self) -> Array:
        """Velocity of the tip and its angular rate, in b (6,) [m/s, rad/s]."""
        twist: Array = self._arm.jacobian(self._q) @ (self._lagging + self._beside)
        return twist
