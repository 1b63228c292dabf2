"""Ingredients of a hand's motion: sines and splines with exact first and second derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pipeline.frames import Array

FADE_S = 1.5
"""From rest to full motion."""
TREMOR_M, TREMOR_DEG = 5e-5, 0.03
"""RMS of a hand's tremor, each axis."""
LIFT_S = 3.0
"""To rise to where one flies."""


class MotionComponent(Protocol):
    """One ingredient of a motion over (x, y, z [m], roll, pitch, yaw [rad])."""

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration at time `t` [s] since the motion's start."""


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """A sum of sines per axis, faded in: ∑ a sin(2π f t + φ)."""

    amplitude: Array
    """(n, 6) [m, rad]."""
    omega: Array
    """(n, 6) angular frequency [rad/s]."""
    phase: Array
    """(n, 6) [rad]."""
    fade_s: float = FADE_S

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        angle = self.omega * t + self.phase
        sines, cosines = self.amplitude * np.sin(angle), self.amplitude * np.cos(angle)
        rows = np.array(
            (
                sines.sum(axis=0),
                (self.omega * cosines).sum(axis=0),
                -(self.omega**2 * sines).sum(axis=0),
            )
        )
        if t >= self.fade_s:  # as nearly always, in full
            return rows
        return weighed(_fade(t / self.fade_s) / self.fade_s ** np.arange(3), rows)


def weighed(weight: Array, rows: Array) -> Array:
    """A motion (3, ..., 6) times a weight (3, ...) that changes: value, rate, acceleration."""
    (w, w1, w2), (x, x1, x2) = weight[..., None], rows
    return np.array([w * x, w1 * x + w * x1, w2 * x + 2.0 * w1 * x1 + w * x2])


@dataclass(frozen=True, slots=True)
class Window:
    """From `start` to `stop` [s] after the motion's start, with soft edges that begin there."""

    start: float
    stop: float
    edge: float = 0.3

    def at(self, t: float) -> Array:
        """(3,): weight 0 to 1, its rate and acceleration."""
        edges = _fade((t - self.start) / self.edge) - _fade((t - self.stop) / self.edge)
        return edges / self.edge ** np.arange(3)


@dataclass(frozen=True, slots=True)
class During:
    """A motion within a window only."""

    part: MotionComponent
    window: Window

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        return weighed(self.window.at(t), self.part.at(t))


@dataclass(frozen=True, slots=True)
class Except:
    """A motion that stops within a window."""

    part: MotionComponent
    window: Window

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        return weighed(np.array([1.0, 0.0, 0.0]) - self.window.at(t), self.part.at(t))


def _fade(s: float) -> Array:
    """(3,) quintic step from 0 to 1 over s in [0, 1], its first and second derivative."""
    s = min(max(s, 0.0), 1.0)
    rest = 1.0 - s
    value, rate = s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * (s * rest) ** 2
    return np.array([value, rate, 60.0 * s * rest * (rest - s)])


@dataclass(frozen=True, slots=True)
class Stroke:
    """There along x, a stay, and back; velocity and acceleration without jumps."""

    reach_m: float
    go_s: float
    stay_s: float
    back_s: float

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        rows = np.zeros((3, 6))
        gone = _fade(t / self.go_s) / self.go_s ** np.arange(3)
        back = _fade((t - self.go_s - self.stay_s) / self.back_s) / self.back_s ** np.arange(3)
        rows[:, 0] = self.reach_m * (gone - back)
        return rows


class Keyed:
    """A spline that begins and ends at rest, and stays where it ended."""

    def __init__(self, spline: BSpline) -> None:
        """`spline` gives (6,) over time [s]; its rates and accelerations vanish at both ends."""
        self._orders = (spline, spline.derivative(1), spline.derivative(2))
        self._first, self._last = float(spline.t[0]), float(spline.t[-1])
        self._begin, self._end = spline(self._first), spline(self._last)

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        if self._first < t < self._last:
            return np.array([order(t) for order in self._orders])
        rows = np.zeros((3, 6))
        rows[0] = self._end if t >= self._last else self._begin
        return rows


def lift(height: float) -> MotionComponent:
    """A rise by `height` [m] within `LIFT_S`, jerk without jumps."""
    still = [(1, np.zeros(6)), (2, np.zeros(6)), (3, np.zeros(6))]
    ends = np.zeros((2, 6))
    ends[1, 2] = height
    return Keyed(make_interp_spline([0.0, LIFT_S], ends, k=7, bc_type=(still, still)))
