"""What a robot's thrusters are given: what was commanded, less of it in silence, without a step."""

from __future__ import annotations

import numpy as np

from hardware.attitude_keeper import AttitudeKeeper
from hardware.fading import Fading
from hardware.follower import ROUNDING
from pipeline.frames import Array

MEAN_OF = 80
"""Commands after which the mean has forgotten two thirds, 0.4 s: what damps a motion cancels in it,
what holds a place does not."""
TO_MEAN_US = 100_000
"""Of a silence until the mean is given."""


class GivenThrusts:
    """Thrusts (m,) [N] of a robot, in and after a silence. Times are [µs]."""

    def __init__(
        self,
        thrusters: int,
        f_max: float,
        max_rise: float,
        ramp_us: int,
        keeper: AttitudeKeeper | None,
    ) -> None:
        """Zero. `keeper`: of a robot that flies."""
        self.commanded = np.zeros(thrusters)
        """By the last command."""
        self._base = np.zeros(thrusters)
        self._mean, self._averaged = np.zeros(thrusters), 0
        """Of what was given lately, and of how many since thrust began, if not of more."""
        self._f_max, self._max_rise = f_max, max_rise
        self._keeper = keeper
        self.fading = Fading(ramp_us)
        """Begins with a silence, and ends with the next command.

        From the mean: the last command may be the whole force that was to end a fast motion, and
        held for long it begins another one.
        """
        self._catching_up = False

    def __bool__(self) -> bool:
        """Whether there is any thrust."""
        return bool(self._base.any())

    def is_beyond(self, thrusts: Array) -> bool:
        """Whether a thrust of these (m,) is outside [0, f_max]."""
        return bool((thrusts < 0.0).any() or (thrusts > self._f_max * ROUNDING).any())

    def is_too_steep(self, thrusts: Array, ahead: int) -> bool:
        """Whether a command so many counters later than the last rises too much."""
        most = (self.commanded + ahead * self._max_rise) * ROUNDING
        return bool((thrusts > most).any())

    def at(self, now_us: int) -> Array:
        """Thrusts to give now (m,) [N]."""
        if not self.fading:
            return self._base.copy()
        last = max(0.0, 1.0 - self.fading.elapsed_us(now_us) / TO_MEAN_US)
        faded = (self._mean + last * (self._base - self._mean)) * self.fading.left(now_us)
        return faded if self._keeper is None else self._keeper.thrusts(faded)

    def follow(self, thrusts: Array, now_us: int) -> None:
        """Give what is commanded; after a silence, go there by steps of the rise allowed."""
        if self.fading:
            self._base, self._catching_up = self.at(now_us), True
            self.fading.end()
        near = self._base - self._max_rise, self._base + self._max_rise
        self._catching_up = self._catching_up and bool(thrusts.any())
        self._base = np.clip(thrusts, *near) if self._catching_up else thrusts.copy()
        self._catching_up = self._catching_up and bool((self._base != thrusts).any())
        self.commanded = thrusts
        if not thrusts.any():
            self._mean, self._averaged = np.zeros_like(self._mean), 0
            return
        self._averaged = min(self._averaged + 1, MEAN_OF)
        self._mean = self._mean + (self._base - self._mean) / self._averaged

    def zero(self) -> None:
        """Give zero thrust at once."""
        self.commanded = np.zeros_like(self.commanded)
        self._base, self._mean = np.zeros_like(self._base), np.zeros_like(self._mean)
        self._averaged = 0
        self.fading.end()
        self._catching_up = False
