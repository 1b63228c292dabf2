"""Hands that hold the virtual phone: smooth functions of time with exact rates, seeded.

Every hand rests for `rest_s`, then moves; positions, angles and their first two derivatives are
continuous, so what the sensors in the hand feel follows from formulas, not from differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from hardware.plant_parameters import StartParameters
from hardware.sim.hand_parts import TREMOR_DEG, TREMOR_M, Keyed, MotionComponent, Waves, lift
from hardware.sim.measured_hands import MEASURED
from pipeline.frames import GRAVITY, Array, R_from_rpy, S_in_b, rotation_about_z

REST_S = 2.0
START = StartParameters(distance=2.5, above=0.0, lift=0.0)
"""Level with the robot, which hangs."""
STEP_M, STEP_DEG, STEP_S = 0.03, 3.0, 0.3
"""The paper's moves of the robot arm (Sec. V-B): 3 cm or 3° in 0.3 s, velocity a triangle."""
CORNER_S = 0.02
"""The arm's acceleration changes sign within this time."""
RECORDED_COLUMNS = "t_s, x_m, y_m, z_m, roll_deg, pitch_deg, yaw_deg"


class HandError(ValueError):
    """A hand that there is not, or a recorded one that can't be used; says what is allowed."""


class Hand(Protocol):
    """Where the phone's camera is, and what its sensors feel."""

    def pose(self, t: float) -> tuple[Array, Array]:
        """(R_fc (3, 3), p_cf_in_f (3,) [m]) at time `t` [s]."""

    def omega_in_c(self, t: float) -> Array:
        """Angular velocity of c with respect to f, in c (3,) [rad/s]."""

    def specific_force_in_c(self, t: float) -> Array:
        """What an ideal accelerometer reads, in c (3,) [m/s²]: +9.8 up at rest."""


class MovingHand:
    """A start pose plus the parts of a motion, along level axes that face along its yaw."""

    def __init__(
        self,
        parts: Sequence[MotionComponent],
        p_start_in_f: Array,
        rpy_start: Array,
        t_moves: float,
    ) -> None:
        """At rest at `p_start_in_f` [m], turned by `rpy_start` [rad], until `t_moves` [s]."""
        self._parts = tuple(parts)
        self._start = np.concatenate((p_start_in_f, rpy_start))
        self._R_fs = rotation_about_z(float(rpy_start[2]))
        self._t_moves = t_moves
        self._latest: tuple[float, Array] | None = None

    def _rows(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration; asked for again and again at one time."""
        latest = self._latest
        if latest is None or latest[0] != t:
            self._latest = latest = t, self._rows_at(t)
        return latest[1]

    def _rows_at(self, t: float) -> Array:
        rows = np.zeros((3, 6))
        if t > self._t_moves:
            for part in self._parts:
                rows += part.at(t - self._t_moves)
        rows[:, :3] = rows[:, :3] @ self._R_fs.T
        rows[0] += self._start
        rows.setflags(write=False)
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


def tremor(
    rng: np.random.Generator, sigma_m: float = TREMOR_M, sigma_deg: float = TREMOR_DEG
) -> MotionComponent:
    """Physiological tremor: 8-12 Hz."""
    return _noise(rng, 8.0 + 4.0 * _strata(rng, 12), sigma_m, sigma_deg)


def steady_wander(
    rng: np.random.Generator, sigma_m: float = 5e-3, sigma_deg: float = 0.4
) -> MotionComponent:
    """Someone trying to hold still: below 0.5 Hz, 5 mm and 0.4° RMS."""
    return _noise(rng, 0.05 + 0.4 * _strata(rng, 12), sigma_m, sigma_deg)


def three_poles(
    rng: np.random.Generator, hz: float, sigma_m: float, sigma_deg: float
) -> MotionComponent:
    """White noise through three poles at `hz`: sines drawn from (1 + (f/f₀)²)⁻³."""
    u = np.linspace(0.0, np.pi / 2.0, 2001)
    share = np.cumsum(np.cos(u) ** 4)  # of the power below f = f₀ tan u
    frequencies: Array = hz * np.tan(np.interp(_strata(rng, 24), share / share[-1], u))
    return _noise(rng, frequencies, sigma_m, sigma_deg)


def step(axis: int, amplitude: float) -> MotionComponent:
    """A move of `amplitude` [m or rad] along one of the six axes within 0.3 s."""
    T, c = STEP_S, CORNER_S
    knots = np.array([0.0, c, 0.5 * (T - c), 0.5 * (T + c), T - c, T])
    acceleration = np.zeros((6, 6))
    acceleration[:, axis] = (0.0, 1.0, 1.0, -1.0, -1.0, 0.0)
    unit = make_interp_spline(knots, acceleration, k=1).antiderivative(2)
    return Keyed(BSpline(unit.t, unit.c * (amplitude / unit(STEP_S)[axis]), unit.k))


def demo() -> MotionComponent:
    """A slow figure of ±15 cm with small turns, 20 s a round: something a newcomer can watch."""
    amplitude = np.array([[0.08, 0.15, 0.06, 0.0, np.deg2rad(1.0), np.deg2rad(1.5)]])
    period_s = np.array([[20.0, 20.0, 10.0, 20.0, 10.0, 20.0]])
    phase = np.array([[-0.5 * np.pi, 0.0, 0.0, 0.0, 0.0, np.pi]])
    return Waves(amplitude, 2.0 * np.pi / period_s, phase, fade_s=4.0)


def circle() -> MotionComponent:
    """A circle of 15 cm across the line of sight, 20 s a round, without turning."""
    amplitude = np.array([[0.0, 0.15, 0.15, 0.0, 0.0, 0.0]])
    phase = np.array([[0.0, 0.0, 0.5 * np.pi, 0.0, 0.0, 0.0]])
    return Waves(amplitude, np.full((1, 6), 2.0 * np.pi / 20.0), phase, fade_s=4.0)


def recorded(path: Path) -> MotionComponent:
    """A hand from a CSV file: a heading line, then 6 rows or more of `RECORDED_COLUMNS`.

    Raises:
        HandError: not such a file; says what is allowed.
    """
    try:
        rows = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise HandError(f"{path}: {error}; allowed: columns {RECORDED_COLUMNS}") from error
    good = rows.shape[1:] == (7,) and len(rows) >= 6 and bool(np.isfinite(rows).all())
    if not good or not bool((np.diff(rows[:, 0]) > 0.0).all()):
        raise HandError(f"{path}: allowed: 6 or more finite rows in order of {RECORDED_COLUMNS}")
    x = rows[:, 1:] - rows[0, 1:]
    x[:, 3:] = np.deg2rad(x[:, 3:])
    still = [(1, np.zeros(6)), (2, np.zeros(6))]
    return Keyed(make_interp_spline(rows[:, 0] - rows[0, 0], x, k=5, bc_type=(still, still)))


def hovering(rng: np.random.Generator, p_bf_in_f: Array, rpy: Array) -> MovingHand:
    """A robot that flies on the spot about `p_bf_in_f` (3,) [m], turned by `rpy` (3,) [rad]."""
    return MovingHand((three_poles(rng, 0.3, 0.03, 1.5), tremor(rng)), p_bf_in_f, rpy, 0.0)


def make_hand(
    kind: str,
    *,
    seed: int = 0,
    start: StartParameters = START,
    p_robot_in_f: Array | None = None,
    yaw_start: float = 0.0,
    t_start: float = 0.0,
    rest_s: float = REST_S,
) -> Hand:
    """The hand called `kind` (of `HANDS`, or a recorded one's path), at rest from `t_start` [s].

    It begins as `start` says from a robot at `p_robot_in_f` [m] (default: 0), and looks at it.

    Raises:
        HandError: an unknown kind or a file that can't be used.
    """
    parts: tuple[MotionComponent, ...]
    if kind in HANDS:
        parts = HANDS[kind](np.random.default_rng(seed))
    elif Path(kind).is_file():
        parts = (recorded(Path(kind)),)
    else:
        raise HandError(f"hand: {kind!r} is neither a file nor one of {', '.join(HANDS)}")
    if start.lift > 0.0:
        parts = (*parts, lift(start.lift))
    behind = rotation_about_z(yaw_start) @ np.array([-start.distance, 0.0, start.above])
    p_start = behind if p_robot_in_f is None else p_robot_in_f + behind
    rpy_start = np.array([0.0, atan2(start.above, start.distance), yaw_start])
    return MovingHand(parts, p_start, rpy_start, t_start + rest_s)


HANDS: dict[str, Callable[[np.random.Generator], tuple[MotionComponent, ...]]] = {
    "still": lambda _: (),
    "steady": lambda rng: (steady_wander(rng), tremor(rng)),
    # "moving" is what the AMES' thrusters can follow; "restless" keeps them at their limits
    "moving": lambda rng: (three_poles(rng, 0.3, 0.03, 1.0), tremor(rng)),
    "restless": lambda rng: (three_poles(rng, 0.5, 0.05, 3.0), tremor(rng)),
    "demo": lambda rng: (demo(), tremor(rng)),
    "circle": lambda rng: (circle(), tremor(rng)),
    "step_x": lambda _: (step(0, STEP_M),),
    "step_y": lambda _: (step(1, STEP_M),),
    "step_z": lambda _: (step(2, STEP_M),),
    "turn_z": lambda _: (step(5, float(np.deg2rad(STEP_DEG))),),
    **{name: hand.parts for name, hand in MEASURED.items()},
}
