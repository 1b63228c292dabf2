"""Does control keep its rate? Judged by the measured time between ticks. Sans-I/O."""

from __future__ import annotations

from collections import deque
from math import isfinite

OVER_S = 0.5
"""What the mean is taken over."""
SLOW = 1.5
"""Times the period. At 200 Hz thrusts are then 2.5 ms later on average: a quarter of the delay that
the loop must still bear to be armed (`MarginsConfig.min_delay_s`). A machine without real time
that is busy elsewhere misses up to a fifth of its ticks (1.25)."""


class TickRate:
    """Mean time from tick to tick over the last half second."""

    def __init__(self, period_s: float, longest_s: float) -> None:
        """Ticks are meant to come every `period_s`.

        A hole counts as no more than `longest_s`: it is told of by itself, many are not.
        """
        self._period_s, self._longest_s = period_s, longest_s
        self._steps: deque[float] = deque()
        self._sum_s = 0.0

    def complaint(self, step_s: float) -> str:
        """Complaint after another tick, `step_s` after the one before it; empty if nothing."""
        if not isfinite(step_s):
            return ""
        step_s = min(step_s, self._longest_s)
        self._steps.append(step_s)
        self._sum_s += step_s
        while self._sum_s - self._steps[0] >= OVER_S:
            self._sum_s -= self._steps.popleft()
        mean_s = self._sum_s / len(self._steps)
        if self._sum_s < OVER_S or mean_s <= SLOW * self._period_s:
            return ""
        return (
            f"Control runs slowly: {1e3 * mean_s:.0f} ms from tick to tick "
            f"instead of {1e3 * self._period_s:.0f}."
        )
