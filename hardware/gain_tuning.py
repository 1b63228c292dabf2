"""Gains that reject disturbances best under stated margins, axis by axis.

Rejection and not bandwidth is sought: what a hand does reaches the thrusters by feed-forward and
through a virtual camera of 0.3 Hz, and needs little bandwidth; what the loop itself must do is hold
against cable, wind and contact. So the measure is how far the body is moved by a unit of force
whose spectrum is that of gusts and hands, by feedback alone:

    J² = (1/π) ∫ |P(jω) / (1 + L(jω))|² · 2 ω₀ / (ω² + ω₀²) dω,   P = 1 / (m s² + c s + k)

Margins are the worst of all bodies that the robot may be (`pipeline.control.robust_margins`), and
hold for the body as told without feed-forward, too, whose measured pull is another loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import pi
from typing import Final

import numpy as np
from scipy.optimize import differential_evolution

from hardware.robot_schema import AXES
from pipeline.control.margins import (
    OMEGA,
    TILT_AXIS,
    AxisMargins,
    Loop,
    S,
    Sensing,
    alike,
    axis_margins,
)
from pipeline.control.robust_margins import MarginGoals, worst_margins, worst_of
from pipeline.frames import Array
from pipeline.gains import Gains

DISTURBANCE_HZ: Final = 0.5
"""Corner of the force's spectrum."""
BOUNDS: Final = np.log([(0.5, 60.0), (0.2, 8.0), (0.01, 2.0)])
"""Of w [rad/s], a and b: Kp = m w², Kd = a m w, Ki = b w Kp."""
SPARE: Final = 1.01
"""Margins are sought so much larger, for gains are rounded."""
DIGITS: Final = 3
"""Significant ones, of a gain that is proposed."""
UNSTABLE: Final = 100.0
FORBIDDEN: Final = 10.0
"""Costs above all that a stable loop, and one with its margins, may have."""


class TuningError(Exception):
    """No gains keep the goals.

    Attributes:
        axis: On this axis.
        lacking: What the nearest ones lack, in words.
    """

    def __init__(self, axis: int, lacking: str) -> None:
        super().__init__(
            f"no gains on {AXES[axis]} keep these margins at this latency; the nearest: {lacking}"
        )
        self.axis, self.lacking = axis, lacking


def tuned(loop: Loop, axes: Iterable[int], sensing: Sensing, goals: MarginGoals) -> Gains:
    """The gains of `loop` with those of `axes` replaced by the best there are.

    The same every time. Roll and pitch of a robot that tilts come first: x and y rest on them.

    Raises:
        TuningError: there are none on some axis.
    """
    rows = np.array([loop.gains.Kp, loop.gains.Ki, loop.gains.Kd])
    known: dict[tuple[float, ...], Array] = {}
    for axis in sorted(axes, key=lambda axis: (axis not in TILT_AXIS.values(), axis)):
        so_far = replace(loop, gains=Gains(*rows.copy()))
        key = alike(so_far, axis)
        if key not in known:
            known[key] = _best(so_far, axis, sensing, goals)
        rows[:, axis] = known[key]
    return Gains(*rows)


def _best(loop: Loop, axis: int, sensing: Sensing, goals: MarginGoals) -> Array:
    """Best Kp, Ki, Kd (3,) of one axis."""
    inertia = float(loop.dynamics.inertia[axis])
    turns_to_move = loop.dynamics.needs_tilt and axis in TILT_AXIS.values()

    def gains_of(x: Array) -> Array:
        w, a, b = np.exp(x)
        Kp, Kd = inertia * w * w, a * inertia * w
        return np.array([Kp, 0.0 if turns_to_move else b * w * Kp, Kd])

    def cost(x: Array) -> float:
        return _cost(with_gains(loop, axis, gains_of(x)), axis, sensing, goals)

    start = _start(loop, axis, inertia)
    found = differential_evolution(
        cost, BOUNDS, x0=start, popsize=12, maxiter=80, tol=1e-4, polish=False, rng=0
    )
    best = _rounded(gains_of(found.x))
    if lacking := goals.lacking(margins_of(with_gains(loop, axis, best), axis, sensing)):
        raise TuningError(axis, lacking)
    return best


def _start(loop: Loop, axis: int, inertia: float) -> Array:
    """What the gains so far are in the terms of the search, within its bounds."""
    Kp, Ki, Kd = (max(float(row[axis]), 1e-6) for row in _rows(loop.gains))
    w = np.sqrt(Kp / inertia)
    return np.clip(np.log([w, Kd / (inertia * w), Ki / (w * Kp)]), *BOUNDS.T)


def _cost(loop: Loop, axis: int, sensing: Sensing, goals: MarginGoals) -> float:
    """Logarithm of J; above all of those, by how much the goals are missed."""
    missing = shortfall(margins_of(loop, axis, sensing), goals)
    if missing > 0.0:
        return FORBIDDEN + missing
    return float(np.log10(moved(loop, axis, sensing)))


def margins_of(loop: Loop, axis: int, sensing: Sensing) -> AxisMargins:
    """The worst of all bodies, and of the one as told without feed-forward."""
    if loop.feedforward is None:
        return worst_margins(loop, axis, sensing)
    without = axis_margins(replace(loop, feedforward=None), axis, sensing)
    return worst_of([without, worst_margins(loop, axis, sensing)]) if without.stable else without


def shortfall(found: AxisMargins, goals: MarginGoals) -> float:
    """By how much the goals are missed, as shares of them; 0: they are kept with some to spare."""
    if not found.stable:
        return UNSTABLE
    pairs = (
        (np.log(found.gain), np.log(goals.gain)),
        (found.phase, goals.phase),
        (found.delay, goals.delay),
        (1.0 / found.peak, 1.0 / goals.peak),
    )
    return float(sum(max(0.0, 1.0 - has / (SPARE * wanted)) for has, wanted in pairs if wanted))


def moved(loop: Loop, axis: int, sensing: Sensing) -> float:
    """J: RMS motion by a disturbance of 1 N or N m RMS, feedback alone [m, rad]."""
    L, _ = replace(loop, feedforward=None).open_loop(axis, sensing)
    d, corner = loop.dynamics, 2.0 * pi * DISTURBANCE_HZ
    mass = d.inertia[axis] * S * S + d.damping[axis] * S + d.stiffness[axis]
    density = 2.0 * corner / (OMEGA**2 + corner**2)
    power = np.abs(1.0 / (mass * (1.0 + L))) ** 2 * density
    return float(np.sqrt(np.trapezoid(power, OMEGA) / pi))


def with_gains(loop: Loop, axis: int, gains: Array) -> Loop:
    """The loop with other gains (3,) Kp, Ki, Kd on one axis."""
    rows = [np.array(row) for row in _rows(loop.gains)]
    for row, value in zip(rows, gains, strict=True):
        row[axis] = value
    return replace(loop, gains=Gains(*rows))


def _rows(gains: Gains) -> tuple[Array, Array, Array]:
    return gains.Kp, gains.Ki, gains.Kd


def _rounded(gains: Array) -> Array:
    return np.array([float(f"{gain:.{DIGITS}g}") for gain in gains])
