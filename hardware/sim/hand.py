"""Hands that hold the virtual phone: smooth functions of time with exact rates, seeded.

Every hand rests for `rest_s`, then moves; positions, angles and their first two derivatives are
continuous, so what the sensors in the hand feel follows from formulas, not from differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pipeline.frames import GRAVITY, Array, R_from_rpy, S_in_b

REST_S = 2.0
FADE_S = 1.5
"""From rest to full motion."""
START_DISTANCE_M = 2.5
STEP_M, STEP_DEG, STEP_S = 0.03, 3.0, 0.3
"""The paper's moves of the robot arm (Sec. V-B): 3 cm or 3° in 0.3 s, velocity a triangle."""
CORNER_S = 0.02
"""The arm's acceleration changes sign within this time."""
RECORDED_COLUMNS = "t_s, x_m, y_m, z_m, roll_deg, pitch_deg, yaw_deg"


class Hand(Protocol):
    """Where the phone's camera is, and what its sensors feel."""

    def pose(self, t: float) -> tuple[Array, Array]:
        """(R_fc (3, 3), p_cf_in_f (3,) [m]) at time `t` [s]."""

    def omega_in_c(self, t: float) -> Array:
        """Angular velocity of c with respect to f, in c (3,) [rad/s]."""

    def specific_force_in_c(self, t: float) -> Array:
        """What an ideal accelerometer reads, in c (3,) [m/s²]: +9.8 up at rest."""


class Part(Protocol):
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
        w, w1, w2 = _fade(t / self.fade_s) / self.fade_s ** np.arange(3)
        angle = self.omega * t + self.phase
        sines, cosines = self.amplitude * np.sin(angle), self.amplitude * np.cos(angle)
        x = sines.sum(axis=0)
        x1 = (self.omega * cosines).sum(axis=0)
        x2 = -(self.omega**2 * sines).sum(axis=0)
        return np.array([w * x, w1 * x + w * x1, w2 * x + 2.0 * w1 * x1 + w * x2])


def _fade(s: float) -> Array:
    """(3,) quintic step from 0 to 1 over s in [0, 1], its first and second derivative."""
    s = min(max(s, 0.0), 1.0)
    rest = 1.0 - s
    value, rate = s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * (s * rest) ** 2
    return np.array([value, rate, 60.0 * s * rest * (rest - s)])


class Keyed:
    """A spline that begins and ends at rest, and stays where it ended."""

    def __init__(self, spline: BSpline) -> None:
        """`spline` gives (6,) over time [s]; its rates and accelerations vanish at both ends."""
        self._orders = (spline, spline.derivative(1), spline.derivative(2))
        self._first, self._last = float(spline.t[0]), float(spline.t[-1])

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        if self._first < t < self._last:
            return np.array([order(t) for order in self._orders])
        rows = np.zeros((3, 6))
        rows[0] = self._orders[0](min(max(t, self._first), self._last))
        return rows


class MovingHand:
    """A start pose plus the parts of a motion; level at the start, facing along yaw."""

    def __init__(
        self, parts: Sequence[Part], p_start_in_f: Array, yaw_start: float, t_moves: float
    ) -> None:
        """At rest at `p_start_in_f` [m] until `t_moves` [s], then moved in its own axes."""
        self._parts = tuple(parts)
        self._start = np.concatenate((p_start_in_f, (0.0, 0.0, yaw_start)))
        self._R_fs = R_from_rpy(self._start[3:])
        self._t_moves = t_moves

    def _rows(self, t: float) -> Array:
        rows = np.zeros((3, 6))
        if t > self._t_moves:
            for part in self._parts:
                rows += part.at(t - self._t_moves)
        rows[:, :3] = rows[:, :3] @ self._R_fs.T
        rows[0] += self._start
        return rows

    def pose(self, t: float) -> tuple[Array, Array]:
        """(R_fc (3, 3), p_cf_in_f (3,) [m])."""
        x = self._rows(t)[0]
        return R_from_rpy(x[3:]), x[:3]

    def omega_in_c(self, t: float) -> Array:
        """Angular velocity of c with respect to f, in c (3,) [rad/s]. Eq. (3)."""
        rows = self._rows(t)
        omega: Array = S_in_b(rows[0, 3:]) @ rows[1, 3:]
        return omega

    def specific_force_in_c(self, t: float) -> Array:
        """Acceleration minus gravity, in c (3,) [m/s²]."""
        rows = self._rows(t)
        force: Array = R_from_rpy(rows[0, 3:]).T @ (rows[2, :3] + (0.0, 0.0, GRAVITY))
        return force


def _noise(
    rng: np.random.Generator, frequencies_hz: Array, sigma_m: float, sigma_deg: float
) -> Waves:
    """Equal sines at `frequencies_hz` (n, 6), random phases; `sigma` is the RMS of each axis."""
    sigma = np.repeat((sigma_m, np.deg2rad(sigma_deg)), 3)
    amplitude = np.broadcast_to(sigma * np.sqrt(2.0 / len(frequencies_hz)), frequencies_hz.shape)
    phase = rng.uniform(0.0, 2.0 * np.pi, frequencies_hz.shape)
    return Waves(amplitude, 2.0 * np.pi * frequencies_hz, phase)


def _strata(rng: np.random.Generator, n: int) -> Array:
    """(n, 6) uniform numbers in (0, 1), one in each n-th of the interval for each axis."""
    return (np.arange(n)[:, None] + rng.uniform(0.0, 1.0, (n, 6))) / n


def tremor(rng: np.random.Generator) -> Part:
    """Physiological tremor: 8-12 Hz, 0.05 mm and 0.03° RMS."""
    return _noise(rng, 8.0 + 4.0 * _strata(rng, 12), 5e-5, 0.03)


def steady_wander(rng: np.random.Generator) -> Part:
    """Someone trying to hold still: below 0.5 Hz, 5 mm and 0.4° RMS."""
    return _noise(rng, 0.05 + 0.4 * _strata(rng, 12), 5e-3, 0.4)


def three_poles(rng: np.random.Generator, hz: float, sigma_m: float, sigma_deg: float) -> Part:
    """White noise through three poles at `hz`: sines drawn from (1 + (f/f₀)²)⁻³."""
    u = np.linspace(0.0, np.pi / 2.0, 2001)
    share = np.cumsum(np.cos(u) ** 4)  # of the power below f = f₀ tan u
    frequencies: Array = hz * np.tan(np.interp(_strata(rng, 24), share / share[-1], u))
    return _noise(rng, frequencies, sigma_m, sigma_deg)


def step(axis: int, amplitude: float) -> Part:
    """A move of `amplitude` [m or rad] along one of the six axes within 0.3 s."""
    T, c = STEP_S, CORNER_S
    knots = np.array([0.0, c, 0.5 * (T - c), 0.5 * (T + c), T - c, T])
    acceleration = np.zeros((6, 6))
    acceleration[:, axis] = (0.0, 1.0, 1.0, -1.0, -1.0, 0.0)
    unit = make_interp_spline(knots, acceleration, k=1).antiderivative(2)
    return Keyed(BSpline(unit.t, unit.c * (amplitude / unit(STEP_S)[axis]), unit.k))


def demo() -> Part:
    """A slow figure of ±15 cm with small turns, 20 s a round: something a newcomer can watch."""
    amplitude = np.array([[0.08, 0.15, 0.06, 0.0, np.deg2rad(1.0), np.deg2rad(1.5)]])
    period_s = np.array([[20.0, 20.0, 10.0, 20.0, 10.0, 20.0]])
    phase = np.array([[-0.5 * np.pi, 0.0, 0.0, 0.0, 0.0, np.pi]])
    return Waves(amplitude, 2.0 * np.pi / period_s, phase, fade_s=4.0)


def circle() -> Part:
    """A circle of 15 cm across the line of sight, 20 s a round, without turning."""
    amplitude = np.array([[0.0, 0.15, 0.15, 0.0, 0.0, 0.0]])
    phase = np.array([[0.0, 0.0, 0.5 * np.pi, 0.0, 0.0, 0.0]])
    return Waves(amplitude, np.full((1, 6), 2.0 * np.pi / 20.0), phase, fade_s=4.0)


def recorded(path: Path) -> Part:
    """A hand from a CSV file: a heading line, then 6 rows or more of `RECORDED_COLUMNS`.

    Raises:
        ValueError: not such a file; says what is allowed.
    """
    try:
        rows = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{path}: {error}; allowed: columns {RECORDED_COLUMNS}") from error
    good = rows.shape[1:] == (7,) and len(rows) >= 6 and bool(np.isfinite(rows).all())
    if not good or not bool((np.diff(rows[:, 0]) > 0.0).all()):
        raise ValueError(f"{path}: allowed: 6 or more finite rows in order of {RECORDED_COLUMNS}")
    x = rows[:, 1:] - rows[0, 1:]
    x[:, 3:] = np.deg2rad(x[:, 3:])
    still = [(1, np.zeros(6)), (2, np.zeros(6))]
    return Keyed(make_interp_spline(rows[:, 0] - rows[0, 0], x, k=5, bc_type=(still, still)))


def make_hand(
    kind: str,
    *,
    seed: int = 0,
    p_start_in_f: Array | None = None,
    yaw_start: float = 0.0,
    t_start: float = 0.0,
    rest_s: float = REST_S,
) -> Hand:
    """The hand called `kind` (of `HANDS`, or a recorded one's path), at rest from `t_start` [s].

    Raises:
        ValueError: an unknown kind or a file that can't be used.
    """
    p_start = np.array([-START_DISTANCE_M, 0.0, 0.0]) if p_start_in_f is None else p_start_in_f
    if kind in HANDS:
        parts = HANDS[kind](np.random.default_rng(seed))
    elif Path(kind).is_file():
        parts = (recorded(Path(kind)),)
    else:
        raise ValueError(f"hand: {kind!r} is neither a file nor one of {', '.join(HANDS)}")
    return MovingHand(parts, p_start, yaw_start, t_start + rest_s)


HANDS: dict[str, Callable[[np.random.Generator], tuple[Part, ...]]] = {
    "still": lambda rng: (),
    "steady": lambda rng: (steady_wander(rng), tremor(rng)),
    # "moving" is what the AMES' thrusters can follow; "restless" keeps them at their limits
    "moving": lambda rng: (three_poles(rng, 0.3, 0.03, 1.0), tremor(rng)),
    "restless": lambda rng: (three_poles(rng, 0.5, 0.05, 3.0), tremor(rng)),
    "demo": lambda rng: (demo(), tremor(rng)),
    "circle": lambda rng: (circle(), tremor(rng)),
    "step_x": lambda rng: (step(0, STEP_M),),
    "step_y": lambda rng: (step(1, STEP_M),),
    "step_z": lambda rng: (step(2, STEP_M),),
    "turn_z": lambda rng: (step(5, float(np.deg2rad(STEP_DEG))),),
}
