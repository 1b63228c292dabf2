"""The posterior Cramér-Rao bound of a `World`: how well anybody could know the relative pose.

An oracle's covariance: a Kalman filter linearised at the truth, which knows the statistics of hand
and robot, the frequencies of the tremor, every noise, and when each thing arrived. No estimator
without that knowledge can be better in the mean over many worlds (Tichavský, Muravchik & Nehorai,
IEEE Trans. Signal Processing 46 (1998) 1386).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from hardware.sim.world import model
from hardware.sim.world.model import Reading
from hardware.sim.world.world import GRID_S, World
from pipeline.frames import Array

Step = Callable[[int], tuple[Array, Array]]


@dataclass(frozen=True, slots=True, eq=False)
class PosteriorBound:
    """Covariances (n, 6, 6) of (δp in c [m], θ in b [rad]), and their times (n,) [s]."""

    t: Array
    now: Array
    """Of now, given what has arrived."""
    t_captured: Array
    captured: Array
    """Of the time of a picture, given all that was taken up to it."""


@dataclass(slots=True, eq=False)
class Oracle:
    """Knowledge at one time: the bound's filter."""

    i: int
    """On the grid."""
    P: Array
    """(N, N), of `model`."""

    def take(self, reading: Reading, step: Step) -> None:
        """Go on to a reading and learn from it."""
        self.advance(reading.i, step)
        PH = self.P @ reading.H.T
        S = reading.H @ PH + np.eye(len(reading.H))
        P = self.P - PH @ np.linalg.solve(S, PH.T)
        self.P = 0.5 * (P + P.T)

    def advance(self, i: int, step: Step) -> None:
        """Go on to a time without news."""
        if i > self.i:
            Phi, Q = step(i - self.i)
            self.P = Phi @ self.P @ Phi.T + Q
            self.i = i


def bound(world: World, every: float = 0.25, start: float = 5.0) -> PosteriorBound:
    """Evaluate `now` every so often from `start` on [s], `captured` at every picture from then."""
    step = _steps(world)
    oracle = Oracle(0, model.prior(world))
    waiting = model.readings(world)
    captured: list[tuple[int, Array]] = []
    t = np.arange(start, world.t[-1], every)
    now = []
    for asked in t:
        while waiting and waiting[0].arrival <= asked:
            reading = waiting.pop(0)
            oracle.take(reading, step)
            if reading.is_picture and len(reading.H) and world.t[reading.i] >= start:
                captured.append((reading.i, oracle.P))
        now.append(
            _at(oracle, [r for r in waiting if r.arrival <= asked], int(world.index(asked)), step)
        )
    pose = model.pose_by_state(world, world.index(t))
    i = np.array([k for k, _ in captured], dtype=np.intp)
    captured_pose, states = model.pose_by_state(world, i), model.size(world)
    return PosteriorBound(
        t=t,
        now=pose @ np.array(now) @ pose.transpose(0, 2, 1),
        t_captured=world.t[i],
        captured=captured_pose
        @ np.array([P for _, P in captured]).reshape(-1, states, states)
        @ captured_pose.transpose(0, 2, 1),
    )


def rms(C: Array) -> tuple[float, float]:
    """RMS of distance [mm] and angle [°] of covariances (n, 6, 6)."""
    p, theta = np.trace(C[:, :3, :3], axis1=1, axis2=2), np.trace(C[:, 3:, 3:], axis1=1, axis2=2)
    return 1e3 * float(np.sqrt(p.mean())), float(np.rad2deg(np.sqrt(theta.mean())))


def _at(oracle: Oracle, arrived: list[Reading], i: int, step: Step) -> Array:
    """Covariance (N, N) at time `i` on the grid, with what has arrived out of order."""
    copy = Oracle(oracle.i, oracle.P)
    for reading in arrived:
        copy.take(reading, step)
    copy.advance(i, step)
    return copy.P


def _steps(world: World) -> Step:
    @cache
    def step(n: int) -> tuple[Array, Array]:
        return model.step(world, n * GRID_S)

    return step
