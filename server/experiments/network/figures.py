"""From what a server heard to figures: how old pictures and records were, and how soon again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Times = npt.NDArray[np.float64]
FRESH_S = 0.1
"""A picture younger than this is fresh."""
STEADY_S = 0.5
"""It has recovered if all pictures of so long are fresh."""
STEP_S = 0.001
"""Between two looks at how old the newest record is."""


@dataclass(frozen=True, slots=True, eq=False)
class Arrivals:
    """Arrivals of one kind: when each was taken, when it came [s], one clock; in order."""

    taken: Times
    came: Times

    @property
    def ages(self) -> Times:
        """When they came [s]."""
        return self.came - self.taken

    def within(self, begin: float, end: float) -> Arrivals:
        """Arrivals of those taken within [begin, end) [s]."""
        inside = (self.taken >= begin) & (self.taken < end)
        return Arrivals(self.taken[inside], self.came[inside])

    def ages_of_newest(self, begin: float, end: float) -> Times:
        """How old the newest one was, looked at often within [begin, end) [s]; inf before any."""
        if len(self.came) == 0:
            return np.full(1, np.inf)
        looks = np.arange(begin, end, STEP_S)
        order = np.argsort(self.came, kind="stable")
        newest = np.concatenate([[-np.inf], np.maximum.accumulate(self.taken[order])])
        ages: Times = looks - newest[np.searchsorted(self.came[order], looks, side="right")]
        return ages


def percentile(values: Times, share: float) -> float:
    """Percentile of `values`, at `share` in percent; NaN of none, inf among infinite ones."""
    if len(values) == 0:
        return float("nan")
    return float(np.sort(values)[min(len(values) - 1, int(share / 100.0 * len(values)))])


def drops(frames: Arrivals, begin: float, end: float, rate_hz: float) -> float:
    """Share of the pictures of a camera at `rate_hz`, within [begin, end) [s], that never came."""
    came = len(np.unique(frames.within(begin, end).taken))
    return max(0.0, 1.0 - came / (rate_hz * (end - begin)))


def recovery(frames: Arrivals, t_over: float) -> float:
    """Time from `t_over` [s], the end of a fault, until pictures come fresh again and go on so.

    inf if they never do.
    """
    after = frames.came >= t_over
    came, stale = frames.came[after], frames.ages[after] > FRESH_S
    for first in np.flatnonzero(~stale):
        soon = (came >= came[first]) & (came < came[first] + STEADY_S)
        if not np.any(stale & soon):
            return float(came[first] - t_over)
    return float("inf")
