"""What a robot makes of the twists that it is told: each after its delay, within its limits."""

from __future__ import annotations

from collections import deque
from copy import deepcopy

import numpy as np

from pipeline.frames import Array
from pipeline.robot import TwistDrive


class DelayedTwist:
    """A clock of whole milliseconds, and what is on its way."""

    def __init__(self, drive: TwistDrive) -> None:
        """At rest, told nothing yet."""
        self._drive = drive
        self._delay_ms, self._now_ms = round(1e3 * drive.delay_s), 0
        self._on_their_way: deque[tuple[int, Array]] = deque()
        self._commanded: Array = np.zeros(6)
        self.allowed: Array = np.zeros(6)
        """What it is to do now, within its accelerations."""

    def tell(self, twist_in_b: Array) -> None:
        """It is told (6,) [m/s, rad/s] now."""
        self._on_their_way.append((self._now_ms + self._delay_ms, np.array(twist_in_b)))

    def step(self, ms: int) -> Array:
        """What it is to do (6,) for the next `ms`."""
        while self._on_their_way and self._on_their_way[0][0] <= self._now_ms:
            self._commanded = self._drive.within(self._on_their_way.popleft()[1])
        self.allowed = self._drive.toward(self.allowed, self._commanded, 1e-3 * ms)
        self._now_ms += ms
        return self.allowed

    def ahead(self, count: int, ms: int) -> list[Array]:
        """What it is to do (6,) in each of the next `count` times `ms`, told nothing more."""
        future = deepcopy(self)
        return [future.step(ms) for _ in range(count)]
