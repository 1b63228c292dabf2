"""Out-of-sequence measurements: late poses and unordered IMU samples, fused when they were taken.

Three copies of the filter lie on the time axis:

    checkpoint ── pictures waiting for IMU samples ── frontier ── now

Up to the *checkpoint* everything has arrived: later news from before it is too late. The *frontier*
knows everything that arrived so far; when a sample arrives from before it, it is made anew from the
checkpoint. Each `to_now` replays only what came after the frontier: the exact answer to what
Bar-Shalom approximates (IEEE Trans. Aerospace and Electronic Systems 38 (2002) 769).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from pipeline.estimation.imu_history import ImuHistory
from pipeline.estimation.paper_ekf_kernels import workspace
from pipeline.estimation.paper_ekf_replay import FAILED, fuse_pose, replay
from pipeline.estimation.relative_model import N
from pipeline.estimator_config import EkfConfig
from pipeline.frames import Array


@dataclass(slots=True, eq=False)
class EkfCheckpoint:
    """The filter at one time."""

    t: float
    x: Array
    """(30,)."""
    P: Array
    """(30, 30)."""
    R_ic: Array
    """(3, 3) rotation of the camera since the phone's last sample."""

    @staticmethod
    def empty() -> EkfCheckpoint:
        """Memory for a checkpoint; its content has no meaning yet."""
        return EkfCheckpoint(-inf, np.zeros(N), np.zeros((N, N)), np.eye(3))

    def copy(self, other: EkfCheckpoint) -> None:
        """Become like `other`."""
        self.t = other.t
        self.x[:], self.P[:], self.R_ic[:] = other.x, other.P, other.R_ic


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A measured (p, η)."""

    t: float
    y: Array
    """(6,) [m, rad]."""
    C: Array
    """(6, 6) its covariance."""


class OutOfSequenceEkf:
    """The filter of `relative_model` on the time axis."""

    def __init__(self, config: EkfConfig) -> None:
        """Empty: `begin` before anything but `history.insert`."""
        self.history = ImuHistory()
        self.checkpoint, self.now = EkfCheckpoint.empty(), EkfCheckpoint.empty()
        self._frontier = EkfCheckpoint.empty()
        self._frontier_good = False
        self._waiting: list[PoseMeasurement] = []
        self._walk, self._r = walk_densities(config), imu_variances(config)
        self._steps = np.array([config.max_step_s, config.tau_delta_c])
        self._work = workspace()

    def begin(self, t: float, x: Array, P: Array) -> None:
        """Start at time `t` [s] from x (30,), P (30, 30)."""
        self.checkpoint = EkfCheckpoint(t, x, P, np.eye(3))
        self._waiting.clear()
        self.history.forget_until(t)
        self._frontier_good = False

    def insert(self, t: float, kind: int, rate: Array, force: Array) -> bool:
        """Remember an IMU sample from after the checkpoint; False: it was there already."""
        if t <= self._frontier.t:
            self._frontier_good = False
        return self.history.insert(t, kind, rate, force)

    def fuse(self, pose: PoseMeasurement, gate: float) -> float:
        """Compare a pose from after the checkpoint with its prediction; fuse it up to `gate`.

        Gives χ² (6 degrees of freedom); NaN: the filter can't be believed.
        """
        final = not self._waiting and pose.t <= min(self.history.newest)
        if not final and not self._renew_frontier():
            return nan
        checkpoint = self.checkpoint if final else self._frontier
        if not self._advance(checkpoint, pose.t):
            return nan
        chi2 = self._update(checkpoint, pose, gate)
        if final:
            self.history.forget_until(pose.t)
            self._frontier_good = False
        elif chi2 <= gate:
            self._waiting.append(pose)
        return chi2

    def settle(self, oldest: float) -> bool:
        """Move the checkpoint to the last complete picture, at least to time `oldest` [s].

        Without pictures it follows at that distance: a replay stays short. False: the filter can't
        be believed.
        """
        complete = max(min(self.history.newest), oldest)
        before = self.checkpoint.t
        while self._waiting and self._waiting[0].t <= complete:
            pose = self._waiting.pop(0)
            if not self._advance(self.checkpoint, pose.t):
                return False
            self._update(self.checkpoint, pose, inf)
        if self.checkpoint.t < oldest and not self._advance(self.checkpoint, oldest):
            return False
        if self.checkpoint.t > before:
            self.history.forget_until(self.checkpoint.t)
            self._frontier_good &= self._frontier.t >= self.checkpoint.t
        return True

    def to_now(self, t: float) -> bool:
        """Bring `now` to time `t` [s]; False: the filter can't be believed."""
        if not self._frontier_good and not self._renew_frontier():
            return False
        complete = min(*self.history.newest, t)
        if complete > self._frontier.t and not self._advance(self._frontier, complete):
            return False
        self.now.copy(self._frontier)
        return self._advance(self.now, t)

    def _renew_frontier(self) -> bool:
        """Make the frontier anew, from the checkpoint through the waiting pictures."""
        self._frontier.copy(self.checkpoint)
        self._frontier_good = True
        for pose in self._waiting:
            if not self._advance(self._frontier, pose.t):
                return False
            self._update(self._frontier, pose, inf)
        return True

    def _update(self, checkpoint: EkfCheckpoint, pose: PoseMeasurement, gate: float) -> float:
        return float(fuse_pose(checkpoint.x, checkpoint.P, pose.y, pose.C, gate, self._work))

    def _advance(self, checkpoint: EkfCheckpoint, t: float) -> bool:
        """Replay the samples up to time `t` [s]; False: the filter can't be believed."""
        history = self.history
        used = replay(
            checkpoint.x,
            checkpoint.P,
            checkpoint.R_ic,
            (checkpoint.t, t),
            history.times,
            history.kinds,
            history.values,
            self._r,
            self._walk,
            self._steps,
            self._work,
        )
        checkpoint.t = t
        return bool(used != FAILED)


def walk_densities(c: EkfConfig) -> Array:
    """(30,) density of the process noise [unit²/s]."""
    per_state = (0.0, 0.0, c.walk_v, c.walk_omega_b, 0.0, c.walk_a_b, c.walk_a_c, c.walk_delta_c)
    return np.repeat(np.square((*per_state, c.walk_bias_omega, c.walk_bias_a)), 3)


def imu_variances(c: EkfConfig) -> Array:
    """Variances of IMU samples (2, 6) by kind [unit²]."""
    body, phone = (c.sigma_omega_b, c.sigma_a_b), (c.sigma_omega_c, c.sigma_a_c)
    return np.repeat(np.square((body, phone)), 3, axis=1)


def initial_variances(c: EkfConfig) -> Array:
    """Variances (30,) at a start; those of the pose come with it [unit²]."""
    rate, force = c.initial_omega, c.initial_a
    sigmas = (0.0, 0.0, c.initial_v, rate, rate, force, force, c.initial_delta)
    return np.repeat(np.square((*sigmas, c.initial_bias_omega, c.initial_bias_a)), 3)
