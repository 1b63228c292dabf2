"""What a robot that takes a twist is given: what was commanded, braked in silence, without a step.

The same part as `given_thrusts.py` has, for `link/robot_end.py`. Braking is linear and takes as
long as from the largest twist allowed, so it never brakes harder than the robot's file allows.
"""

from __future__ import annotations

import numpy as np

from hardware.fading import Fading
from hardware.follower import ROUNDING
from pipeline.config import PERIOD_S
from pipeline.frames import Array
from pipeline.robot import TwistDrive

ABOUT_ZERO = 1e-6
"""Changes of a twist below are rounding [m/s, rad/s]."""


class GivenTwist:
    """Twist (6,) in b [m/s, rad/s] of a robot, in and after a silence. Times are [µs]."""

    def __init__(self, drive: TwistDrive) -> None:
        """Zero."""
        self.commanded = np.zeros(6)
        """By the last command."""
        self._base = np.zeros(6)
        self._drive = drive
        self.fading = Fading(round(1e6 * drive.stop_s))
        """Brakes from a silence on, until the next command."""
        self._catching_up = False

    def __bool__(self) -> bool:
        """Whether there is any motion to brake."""
        return bool(self._base.any())

    def is_beyond(self, twist_in_b: Array) -> bool:
        """Whether a twist (6,) is larger than the robot's file allows."""
        return self._drive.exceeds(twist_in_b, ROUNDING)

    def is_too_steep(self, twist_in_b: Array, ahead: int) -> bool:
        """Whether a command so many counters later than the last changes too much.

        Zero may always follow: the robot brakes as hard as it may.
        """
        reached = self._drive.toward(self.commanded, twist_in_b, PERIOD_S * ahead)
        return bool(np.abs(twist_in_b - reached).max() > ABOUT_ZERO and twist_in_b.any())

    def at(self, now_us: int) -> Array:
        """Twist to give now (6,)."""
        return self._base * self.fading.left(now_us) if self.fading else self._base.copy()

    def follow(self, twist_in_b: Array, now_us: int) -> None:
        """Give what is commanded; after a silence, go there by steps of the change allowed."""
        if self.fading:
            self._base, self._catching_up = self.at(now_us), True
            self.fading.end()
        self._catching_up = self._catching_up and bool(twist_in_b.any())
        if self._catching_up:
            self._base = self._drive.toward(self._base, twist_in_b, PERIOD_S)
            self._catching_up = bool((self._base != twist_in_b).any())
        else:
            self._base = twist_in_b.copy()
        self.commanded = twist_in_b

    def zero(self) -> None:
        """Give zero at once."""
        self.commanded, self._base = np.zeros(6), np.zeros(6)
        self.fading.end()
        self._catching_up = False
