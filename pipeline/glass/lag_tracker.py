"""By how much a display's lag was misjudged, by its lights while they move.

Light that is drawn for another time than the one at which it leaves the glass is seen where the
robot was, or will be: beside its place, along its velocity. Least squares of that over some
seconds, with a place beside of each light's own, for fiducials and file may be a little wrong.
"""

from __future__ import annotations

from collections import deque
from math import sqrt
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.glass.display_lag import SURE_S, DisplayLag

WINDOW_S: Final = 3.0
PATH_S: Final = 0.5
"""Places are remembered for so long: a picture may come late."""
NEAR_M: Final = 0.008
"""A light farther from any place is none of the robot's."""
LEAST: Final = 50
"""Lights, before anything is said, ..."""
LEAST_S: Final = 1.0
"""... over so long."""
ALIKE_S: Final = 0.3
"""Lights within it err alike, by the eye's own error."""


class LagTracker:
    """One display, since its lag was believed."""

    def __init__(self) -> None:
        """Nothing drawn yet."""
        self._path: deque[tuple[float, Array]] = deque()
        self._seen: deque[tuple[float, int, Array, Array]] = deque()
        """(When, which LED, by how much beside its place (2,) [m], its velocity (2,) [m/s])."""

    def add_drawn(self, t: float, places: Array) -> None:
        """Take places (n, 2) [m] that are drawn for light of `t` [s]; NaN where there is none."""
        self._path.append((t, places))
        while t - self._path[0][0] > PATH_S:
            self._path.popleft()

    def add_seen(self, t: float, lights: Array) -> None:
        """Take lights (m, 2) [m] that a picture of `t` [s] saw on the glass."""
        found = self._at(t)
        if found is None:
            return
        places, velocities = found
        for light in lights:
            beside = light - places
            apart = np.nan_to_num(np.hypot(beside[:, 0], beside[:, 1]), nan=np.inf)
            led = int(apart.argmin())
            if apart[led] < NEAR_M:
                self._seen.append((t, led, beside[led], velocities[led]))
        while self._seen and t - self._seen[0][0] > WINDOW_S:
            self._seen.popleft()

    def corrected(self, by_s: float) -> None:
        """So much less is believed of the lag from now on: what was seen is as if it always was."""
        self._seen = deque(
            (t, led, beside - by_s * velocity, velocity) for t, led, beside, velocity in self._seen
        )

    def error(self) -> DisplayLag | None:
        """What is believed of the lag, less what it is; None while nobody can say."""
        if len(self._seen) < LEAST or self._seen[-1][0] - self._seen[0][0] < LEAST_S:
            return None
        t, leds, besides, velocities = zip(*self._seen, strict=True)
        led, r, v = np.array(leds), np.array(besides), np.array(velocities)
        for one in np.unique(led):
            r[led == one] -= r[led == one].mean(axis=0)
            v[led == one] -= v[led == one].mean(axis=0)
        moved = float(np.square(v).sum())
        if moved == 0.0:
            return None
        value = float((v * r).sum()) / moved
        spans = ((np.array(t) - t[-1]) / ALIKE_S).astype(int)
        scores = np.bincount(-spans, ((r - value * v) * v).sum(axis=1))
        few = len(scores) / (len(scores) - 1.0)
        found = DisplayLag(value, float(np.linalg.norm(scores)) / moved * sqrt(few))
        return found if found.sigma < SURE_S else None

    def _at(self, t: float) -> tuple[Array, Array] | None:
        """Places and velocities (n, 2) of light of `t`; None if nobody remembers."""
        times = [one for one, _ in self._path]
        k = int(np.searchsorted(times, t))
        if not 0 < k < len(times):
            return None
        (before, a), (after, b) = self._path[k - 1], self._path[k]
        velocities: Array = (b - a) / (after - before)
        return a + (t - before) * velocities, velocities
