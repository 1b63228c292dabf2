"""Offset and drift of a clock: the line with most room between the bounds by round trips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.frames import Array

MAX_DRIFT: Final = 6e-4
"""Quartz and a clock that is being slewed [s/s]."""
DRIFT_COST_S: Final = 1.0
"""Room that a drift must gain per drift to be believed: a second says nothing of drifts."""
_GRID: Final[Array] = np.linspace(-1.0, 1.0, 25)
_ROUNDS: Final = 3
"""Each finds the drift 12 times as exactly."""


@dataclass(frozen=True, slots=True)
class OffsetBound:
    """The offset at our time `t` [s] is not beyond `offset` [s]."""

    t: float
    offset: float


@dataclass(slots=True)
class TightestBounds:
    """The tightest bounds of a span."""

    t: float
    lower: OffsetBound
    upper: OffsetBound


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Offset over our time."""

    t: float
    offset: float
    """At `t` [s]."""
    drift: float
    """[s/s]."""
    error: float
    """The offset at `t` is no farther from this than [s]."""
    room: float
    """Half of the gap between the bounds [s]; negative: they contradict each other."""

    def at(self, t: float) -> float:
        """Offset [s]."""
        return self.offset + self.drift * (t - self.t)


def fit(buckets: Sequence[TightestBounds], t: float) -> ClockLine:
    """The line with the most room between the bounds, seen from time `t` [s]."""
    base = buckets[-1].lower.offset
    rows = [(b.lower.t - t, b.lower.offset, b.upper.t - t, b.upper.offset) for b in buckets]
    x_low, low, x_up, up = np.array(rows).T
    low, up = low - base, up - base
    drifts = MAX_DRIFT * _GRID
    width = MAX_DRIFT
    error = room = middle = drift = 0.0
    for round_ in range(_ROUNDS):
        top = (up - np.outer(drifts, x_up)).min(axis=1)
        bottom = (low - np.outer(drifts, x_low)).max(axis=1)
        best = int(np.argmax(0.5 * (top - bottom) - DRIFT_COST_S * np.abs(drifts)))
        drift, room = float(drifts[best]), 0.5 * float(top[best] - bottom[best])
        middle = 0.5 * float(top[best] + bottom[best])
        if round_ == 0:
            error = _reach(top, bottom, best)
        width *= 2.0 / (len(_GRID) - 1)
        drifts = np.clip(drift + width * _GRID, -MAX_DRIFT, MAX_DRIFT)
    return ClockLine(t, base + middle, drift, max(error, 0.0), room)


def _reach(top: Array, bottom: Array, best: int) -> float:
    """How far from the best line's offset others that keep the bounds may be; (n,) by drift."""
    possible = np.flatnonzero(top >= bottom)
    first = max((int(possible[0]) if len(possible) else best) - 1, 0)
    last = min((int(possible[-1]) if len(possible) else best) + 1, len(top) - 1)
    highest, lowest = top[first : last + 1].max(), bottom[first : last + 1].min()
    middle = 0.5 * (top[best] + bottom[best])
    return float(max(highest - middle, middle - lowest))
