"""How a robot that takes a twist moves by what it was told, and by what it measures of it later.

By wheels or joints it says so ten or fifty times a second, late, with noise; what it was told says
so at any time, ahead of the motion, for a robot as its file has it. So the measured twist corrects:
by how much it was off what was presumed *for its own time* counts until the next one comes.
"""

from __future__ import annotations

from collections import deque
from math import exp

import numpy as np

from pipeline.frames import Array
from pipeline.robot import TwistDrive

REMEMBERED = 200
"""Of what was presumed: a second of a robot that is told 200 times in it."""


class PresumedTwist:
    """A robot's twist by its drive's delay and lag. Times are [s].

    Zero at once (STOP) takes it longer, by its own limits; then nobody leads it by this.
    """

    def __init__(self, drive: TwistDrive) -> None:
        """At rest."""
        self._lag_s, self._delay_s = drive.lag_s, drive.delay_s
        self._on_their_way: deque[tuple[float, Array]] = deque()
        self._told = self._halfway = self._moves = np.zeros(6)
        self._last = 0.0
        self._past: deque[tuple[float, Array]] = deque(maxlen=REMEMBERED)
        self._off = np.zeros(6)

    def tell(self, twist_in_b: Array, now: float) -> None:
        """It is told a twist (6,)."""
        self._on_their_way.append((now + self._delay_s, twist_in_b))
        self._move(now)

    def measured(self, twist_in_b: Array, t: float) -> None:
        """It measured its twist (6,) at `t`, later than any before."""
        then = next((moves for past, moves in reversed(self._past) if past <= t), self._moves)
        self._off = twist_in_b - then

    def at(self, now: float) -> Array:
        """Its twist (6,) now: two equal lags behind each other, as `TwistPlant` has."""
        self._move(now)
        moves: Array = self._moves + self._off
        return moves

    @property
    def rate(self) -> Array:
        """How that changes (6,) [m/s², rad/s²]."""
        rate: Array = (self._halfway - self._moves) / (0.5 * self._lag_s)
        return rate

    def _move(self, now: float) -> None:
        while self._on_their_way and self._on_their_way[0][0] <= now:
            begins, told = self._on_their_way.popleft()
            self._pass_until(begins)
            self._told = told
        self._pass_until(now)
        if not self._past or self._last > self._past[-1][0]:
            self._past.append((self._last, self._moves))

    def _pass_until(self, t: float) -> None:
        """The exact motion for a twist that stays."""
        lags = max(0.0, t - self._last) / (0.5 * self._lag_s)
        halfway, moves = self._halfway - self._told, self._moves - self._told
        self._moves = self._told + exp(-lags) * (moves + lags * halfway)
        self._halfway = self._told + exp(-lags) * halfway
        self._last = max(self._last, t)
