"""Display lag: how long after it is drawn a light leaves the glass, by a phone that films it.

A light sweeps over the glass as a sine of the time at which it is drawn; pictures say where it was
when they were taken, by their dates: what these are wrong by is in the lag too. Where a glass that
stands still tells by how much (`RobotOfLight.lag`), it is taken off again.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array

SWEEP_HZ = 1.0
"""Of the sweep: any lag up to nearly a second is told from any other."""
SWEEP_SHARE = 0.2
"""Amplitude of the sweep, of the glass's width."""
LEAST_SWEEPS_S = 2.0
"""Filmed for so long a sweep can't be mistaken."""
LEAST_PICTURES = 8
KEPT_S = 4.0
SURE_S = 0.003
"""Standard deviation of a lag that may be used [s]."""
MOST_LAG_S = 0.080
"""A display of 60 ms, whose light stays for a frame. Beyond it the loop has no margin left: what is
drawn ahead is guessed."""
BORNE_S = 0.010
"""So much more is borne of a lag that is corrected while somebody leads."""
LEAST_LAG_S = -0.030
"""A lag below it can be none, unless the pictures' dates are wrong by more than they may."""
OUTLYING = 5.0
"""Times the median by which pictures are off that show another light."""
MOST_MISFIT = 0.1
"""RMS of what the sweep does not explain, of its amplitude."""


@dataclass(frozen=True, slots=True)
class DisplayLag:
    """A measured lag."""

    value: float
    """[s]."""
    sigma: float
    """[s]."""

    def is_fit(self, *, is_shown: bool = False) -> bool:
        """Whether a robot can be led on that display, or `is_shown` on it may stay there."""
        return LEAST_LAG_S <= self.value <= MOST_LAG_S + (BORNE_S if is_shown else 0.0)


def swept(t: Array) -> Array:
    """Where the light is drawn at times (n,) [s], as a share of the amplitude: right is 1."""
    share: Array = np.sin(2.0 * np.pi * SWEEP_HZ * t)
    return share


class DisplayLagMeter:
    """Collects where pictures saw the sweeping light."""

    def __init__(self, amplitude_m: float) -> None:
        """Begin with nothing seen."""
        self._amplitude_m = amplitude_m
        self._seen: deque[tuple[float, float]] = deque()

    def add_position(self, t: float, right_m: float) -> None:
        """A picture taken at `t` [s] saw the light so far to the right of the middle."""
        self._seen.append((t, right_m))
        while t - self._seen[0][0] > KEPT_S:
            self._seen.popleft()

    def lag(self) -> DisplayLag | None:
        """The lag, once it is known."""
        found = self._fit()
        return found if found is not None and found.sigma < SURE_S else None

    def _fit(self) -> DisplayLag | None:
        """Least squares of a sine's two parts and a place; None while they don't tell.

        A few pictures may show another light, as do those before the sweep is on the glass.
        """
        if len(self._seen) < LEAST_PICTURES:
            return None
        t, right = np.array(self._seen).T
        phase = 2.0 * np.pi * SWEEP_HZ * t
        A = np.column_stack((np.sin(phase), np.cos(phase), np.ones(len(t))))
        off = np.abs(right - A @ np.linalg.lstsq(A, right, rcond=None)[0])
        shows = off <= OUTLYING * np.median(off)
        t, A, right = t[shows], A[shows], right[shows]
        if len(t) < LEAST_PICTURES or t[-1] - t[0] < LEAST_SWEEPS_S:
            return None
        (s, c, middle), *_ = np.linalg.lstsq(A, right, rcond=None)
        size = float(np.hypot(s, c))
        misfit = float(np.sqrt(np.mean((right - A @ (s, c, middle)) ** 2)))
        is_sweep = 0.5 < size / self._amplitude_m < 2.0 and misfit < MOST_MISFIT * size
        if not is_sweep:
            return None
        omega = 2.0 * np.pi * SWEEP_HZ
        sigma = misfit / (size * omega) * float(np.sqrt(2.0 / len(t)))
        return DisplayLag(float(np.arctan2(-c, s)) / omega, sigma)
