"""Evaluator: an estimator against the ground truth of a `World`, now and at images' times."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Final, Protocol, runtime_checkable

import numpy as np

from hardware.sim.world.rotations import log_each
from hardware.sim.world.sensors import Sample, feed
from hardware.sim.world.world import World
from pipeline.estimation.estimator import Estimator, Fusion
from pipeline.frames import Array
from pipeline.signals import PhoneImu, RelativeState, VisionMeasurement

HEALTH_TICKS: Final = 20
"""Telemetry is noted so rarely."""
Believed = tuple[Array, Array, Array]
"""(p_bc_in_c, R_cb, covariance)."""


@runtime_checkable
class KnowsCapture(Protocol):
    """An estimator that also tells what it knew at the time of the newest fused picture."""

    def last_fused(self) -> tuple[float, Array, Array, Array] | None:
        """Time [s], p_bc_in_c, R_cb and covariance at the newest fused image."""


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Truth minus estimate at n times; NaN where there was none."""

    t: Array
    """(n,) [s]."""
    e: Array
    """(n, 6): δp in c [m], θ in b [rad]."""
    C: Array
    """(n, 6, 6): what the estimator believed of them."""

    def nees(self) -> Array:
        """NEES (n,) eᵀC⁻¹e, 6 in the mean when it is honest; NaN without an estimate."""
        C = np.where(np.isfinite(self.C), self.C, np.eye(6))
        nees: Array = np.einsum("ni,ni->n", self.e, np.linalg.solve(C, self.e[..., None])[..., 0])
        return nees

    def during(self, start: float, stop: float) -> Errors:
        """Errors at start ≤ t < stop [s]."""
        chosen = (self.t >= start) & (self.t < stop)
        return Errors(self.t[chosen], self.e[chosen], self.C[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class EstimatorRun:
    """One run of one estimator through one world."""

    now: Errors
    """At each tick."""
    captured: Errors
    """At the time of each fused picture, known then; none if the estimator doesn't tell."""
    u_error: Array
    """(n, 3) of the velocity at each tick [m/s]."""
    held_error: Array
    """(n, 3) of p seen in the frame of the phone's last sample, with which a virtual camera works
    [m]."""
    health: Array
    """(m, 4) t [s], NIS/dof, time offset [s], its σ [s]."""


def run(estimator: Estimator, world: World) -> EstimatorRun:
    """Feed the world to the estimator, ask it every 5 ms, and compare."""
    notes = _Notes(estimator, world)
    for now, state in feed(estimator, world, observe=notes.observe):
        notes.tick(now, state)
    return notes.track()


class _Notes:
    """Notes taken during one run."""

    def __init__(self, estimator: Estimator, world: World) -> None:
        self._estimator, self._world = estimator, world
        self._newest, self._stamp = 0.0, -inf
        self._t: list[float] = []
        self._now: list[Believed] = []
        self._u: list[Array] = []
        self._held: list[Array] = []
        self._captured: list[tuple[float, Believed]] = []
        self._health: list[tuple[float, float, float, float]] = []

    def observe(self, sample: Sample, fusion: Fusion | None) -> None:
        """Note the phone's newest sample, and what is known at a fused picture."""
        if isinstance(sample, PhoneImu):
            self._newest = max(self._newest, sample.t)
        elif (
            isinstance(sample, VisionMeasurement)
            and fusion
            and isinstance(self._estimator, KnowsCapture)
        ):
            known = self._estimator.last_fused()
            if known is not None and sample.t > self._stamp:  # it tells of the newest only
                self._stamp = sample.t
                self._captured.append((self._world.taken(sample.t), known[1:]))

    def tick(self, now: float, state: RelativeState | None) -> None:
        """Note the estimate."""
        self._t.append(now)
        if len(self._t) % HEALTH_TICKS == 0:
            health = self._estimator.health
            self._health.append((now, health.nis, health.time_offset, health.time_offset_sigma))
        if state is None:
            self._now.append(_NOTHING)
            self._u.append(_NOTHING[0])
            self._held.append(_NOTHING[0])
            return
        self._now.append((state.p_bc_in_c, state.R_cb, self._estimator.covariance))
        self._u.append(state.u_bf_in_c)
        k, last = self._world.index((now, self._newest))
        R_ic = self._world.R_fc[last].T @ self._world.R_fc[k]
        self._held.append(R_ic @ self._world.p[k] - state.R_ic @ state.p_bc_in_c)

    def track(self) -> EstimatorRun:
        """The run against the ground truth."""
        t = np.array(self._t)
        return EstimatorRun(
            now=_compare(self._world, t, self._now),
            captured=_compare(
                self._world,
                np.array([t for t, _ in self._captured]),
                [known for _, known in self._captured],
            ),
            u_error=self._world.u[self._world.index(t)] - np.array(self._u),
            held_error=np.array(self._held),
            health=np.array(self._health).reshape(-1, 4),
        )


_NOTHING: Final[Believed] = (np.full(3, np.nan), np.full((3, 3), np.nan), np.full((6, 6), np.nan))


def _compare(world: World, t: Array, believed: list[Believed]) -> Errors:
    p = np.array([b[0] for b in believed]).reshape(-1, 3)
    R = np.array([b[1] for b in believed]).reshape(-1, 3, 3)
    C = np.array([b[2] for b in believed]).reshape(-1, 6, 6)
    i = world.index(t)
    theta = log_each(R.transpose(0, 2, 1) @ world.R[i])
    return Errors(t, np.concatenate((world.p[i] - p, theta), axis=1), C)
