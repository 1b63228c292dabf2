"""What a phone's motion sensors say while it lies still: of each second that was such a one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import floor, inf, nan
from typing import Final

import numpy as np

from pipeline.frames import Array

STILL_S: Final = 1.0
STILL_RAD_S, STEADY_RAD_S = 0.03, 0.01
"""A phone that lies: its mean rate within the one, a bias, and its spread within the other."""
LEAST, COVERED = 5, 0.8
"""Samples in such a second, and how much of it they must span."""


@dataclass(frozen=True, slots=True)
class Rest:
    """A second of rest."""

    t: float
    """Of its last sample [s]."""
    spread: float
    """Of the rate [rad/s]."""
    bias: float
    """Mean rate [rad/s]."""
    gravity: float
    """[m/s²]."""


NO_REST: Final = Rest(-inf, inf, nan, nan)


class _Second:
    """Sums over one second's samples."""

    def __init__(self) -> None:
        self._n, self._first, self._last = 0, inf, -inf
        self._rate, self._rate_2, self._force = np.zeros(3), np.zeros(3), np.zeros(3)

    def add(self, t: float, rate: Array, force: Array) -> None:
        self._n += 1
        self._first, self._last = min(self._first, t), t
        self._rate += rate
        self._rate_2 += np.square(rate)
        self._force += force

    def rest(self) -> list[Rest]:
        """Itself, if it is one of rest and nearly whole."""
        if self._n < LEAST or self._last - self._first < COVERED * STILL_S:
            return []
        mean = self._rate / self._n
        spread = _norm(np.sqrt(np.maximum(self._rate_2 / self._n - np.square(mean), 0.0)))
        if _norm(mean) >= STILL_RAD_S or spread >= STEADY_RAD_S:
            return []
        return [Rest(self._last, spread, _norm(mean), _norm(self._force / self._n))]


class RestLog:
    """Feed it each sample; it remembers the seconds of rest."""

    def __init__(self, most: int | None = None) -> None:
        """Remember so many, or all."""
        self._found: deque[Rest] = deque(maxlen=most)
        self._begin: float | None = None
        self._second = _Second()

    def add(self, t: float, rate: Array, force: Array) -> None:
        """Take a sample of `t` [s]: rate (3,) [rad/s] and specific force (3,) [m/s²]."""
        if self._begin is None:
            self._begin = t
        past = floor((t - self._begin) / STILL_S)
        if past > 0:
            self._found.extend(self._second.rest())
            self._second = _Second()
            self._begin += past * STILL_S
        self._second.add(t, rate, force)

    def stillest(self, since: float) -> Rest:
        """The one with the least spread, of those that ended after `since` [s]; or `NO_REST`."""
        late = [rest for rest in (*self._found, *self._second.rest()) if rest.t >= since]
        return min(late, key=lambda rest: rest.spread, default=NO_REST)


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))
