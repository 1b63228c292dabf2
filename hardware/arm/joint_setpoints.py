"""What an arm's servos are told: angles, each a step of the inverse kinematics after the last.

Servos are told where they shall be after their lag, so that the arm is where it shall be now, and
stands as soon as it shall. Going on from what it shall do, and not from what was measured, nothing
drifts by what servos bend under their load or by encoders' steps. An arm that is held back is told
no more than `AHEAD_RAD` beyond where it is, so that let go it does not leap; nor does it for an
encoder that tells a wild angle: what is told changes no faster than joints turn.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from hardware.arm.inverse_kinematics import InverseKinematics
from pipeline.frames import Array

AHEAD_RAD: Final = 0.15
"""A servo that lags by 60 ms at 120 °/s is 0.13 behind what it is told."""


class JointSetpoints:
    """Of one arm."""

    def __init__(self, kinematics: InverseKinematics, measured: Array) -> None:
        """Where it is: angles (n,) [rad]."""
        self._kinematics, arm = kinematics, kinematics.arm
        self.wanted: Array = np.clip(measured, arm.low, arm.high)
        """Where it shall be now (n,) [rad] ..."""
        self.rates: Array = np.zeros(len(measured))
        """... and how it shall move [rad/s]."""

    def follow(self, twist_in_b: Array, measured: Array, h: float) -> Array:
        """Angles (n,) [rad] to be told now, for a twist (6,) of the tip during the last `h` [s].

        `measured`: angles (n,) [rad] as the servos tell them.
        """
        arm, before = self._kinematics.arm, self.wanted
        wanted = before + h * self._kinematics.rates(before, twist_in_b, h)
        near = np.clip(wanted, measured - AHEAD_RAD, measured + AHEAD_RAD)
        most = arm.parameters.rate * h
        self.wanted = np.clip(np.clip(near, before - most, before + most), arm.low, arm.high)
        self.rates = (self.wanted - before) / h
        return np.clip(self.wanted + arm.parameters.servo_lag_s * self.rates, arm.low, arm.high)
