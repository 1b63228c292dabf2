"""What a robot that takes attitude and thrust is given: what was commanded, level in silence.

The same part as `given_thrusts.py` has, for `link/robot_end.py`, and by it for the thrust: in
silence that fades to zero within the ramp. The lean and the turn of the last command end within
100 ms meanwhile: its own autopilot keeps it level.
"""

from __future__ import annotations

import numpy as np

from hardware.follower import LIFT, ROUNDING
from hardware.given_thrusts import TO_MEAN_US, GivenThrusts
from pipeline.frames import Array
from pipeline.robot import AttitudeDrive


class GivenAttitude:
    """Roll, pitch [rad], yaw rate [rad/s] and thrust [N] (4,) of a robot. Times are [µs]."""

    def __init__(self, drive: AttitudeDrive, most: float, max_rise: float, ramp_us: int) -> None:
        """Zero; a thrust of `most` and a rise of `max_rise` per command at most [N]."""
        self.commanded = np.zeros(4)
        """By the last command."""
        self._drive, self._lift = drive, GivenThrusts(1, most, max_rise, ramp_us, None)
        self.fading = self._lift.fading
        """Level from a silence on, and the thrust falls."""

    def __bool__(self) -> bool:
        """Whether there is any thrust."""
        return bool(self._lift)

    def is_beyond(self, told: Array) -> bool:
        """Whether one of these (4,) is more than the robot's file allows."""
        roll, pitch, yaw_rate, _ = told.tolist()
        return self._drive.exceeds(roll, pitch, yaw_rate, ROUNDING) or self._lift.is_beyond(
            told[LIFT]
        )

    def is_too_steep(self, told: Array, ahead: int) -> bool:
        """Whether the thrust of a command so many counters later than the last rises too much."""
        return self._lift.is_too_steep(told[LIFT], ahead)

    def at(self, now_us: int) -> Array:
        """What to give now (4,)."""
        leans = max(0.0, 1.0 - self.fading.elapsed_us(now_us) / TO_MEAN_US) * self.commanded
        return np.concatenate((leans[: LIFT.start], self._lift.at(now_us)))

    def follow(self, told: Array, now_us: int) -> None:
        """Give what is commanded; after a silence the thrust goes there by the rise allowed."""
        self._lift.follow(told[LIFT], now_us)
        self.commanded = told

    def zero(self) -> None:
        """Give zero at once."""
        self._lift.zero()
        self.commanded = np.zeros(4)
