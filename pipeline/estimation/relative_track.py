"""The relative filter on the time axis: each picture is fused at the moment it was taken.

    base ── picture ── picture ── … ── frontier ── now

A `Checkpoint` is the filter right after a picture. What arrives late (a picture between two others,
an IMU sample that was held or interpolated over) spoils the checkpoints after it; they are made
anew from the last good one, with the decisions on outliers they were made with. The *frontier* is
as far as both IMUs' samples reach; from there to now the newest samples are held, with growing
doubt.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt
from typing import Final

import numpy as np

from pipeline.estimation.hand_motion_kernels import TAPS
from pipeline.estimation.imu_history import ImuHistory
from pipeline.estimation.ray_kernels import TOUCHED, fuse_rays, is_sound
from pipeline.estimation.relative_kernels import (
    INPUTS,
    MOVING,
    X_OFFSET,
    N,
    X,
    apply,
    inputs_at,
    transit,
)
from pipeline.estimation.relative_noise import hand_of, noise_of, walks_of
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Array, cross
from pipeline.signals import Flags, VisionMeasurement

KEPT: Final = TAPS
"""Samples up to the base that are still interpolated and extrapolated from."""
BENT: Final = 2
"""Samples before a new one from which on the curve through them changes."""


@dataclass(slots=True, eq=False)
class Checkpoint:
    """The filter at one time."""

    t: float
    x: Array
    """(19,)."""
    R: Array
    """(3, 3)."""
    P: Array
    """(22, 22)."""
    R_ic: Array
    """(3, 3) rotation of the camera since the phone's last sample."""
    seen: VisionMeasurement | None = None
    """The picture that was fused here."""
    use: Flags | None = None
    """(m,) which of its LEDs were."""
    inflation: float = 1.0
    """Factor of the variances of place, velocity and attitude that were predicted for it."""

    @staticmethod
    def empty() -> Checkpoint:
        """Memory for a checkpoint; its content has no meaning yet."""
        return Checkpoint(-inf, np.zeros(X), np.eye(3), np.zeros((N, N)), np.eye(3))

    def copy(self, other: Checkpoint) -> None:
        """Become like `other`, its picture aside."""
        self.t = other.t
        self.x[:], self.R[:], self.P[:] = other.x, other.R, other.P
        self.R_ic[:] = other.R_ic


class RelativeTrack:
    """State and covariance at any time between the base and now."""

    def __init__(self, config: RelativeConfig, leds_in_b: Array) -> None:
        """Empty: `begin` before anything but `insert`."""
        self._leds_in_b = np.ascontiguousarray(leds_in_b)
        self.body, self.phone = ImuHistory(), ImuHistory()
        self.checkpoints: list[Checkpoint] = []
        self.now = Checkpoint.empty()
        self._frontier = Checkpoint.empty()
        self._spoilt_from = -inf
        """Anchors and frontier after this time must be made anew; inf: none."""
        self._config, self._walks = config, walks_of(config)
        self._phone_factor = 0.0
        self.doubt_phone(1.0)
        self._gate, self._still = config.gate_chi2, config.offset_still
        self._F, self._G = np.zeros((MOVING, MOVING)), np.zeros((MOVING, INPUTS))
        self._Q, self._steps = np.zeros((MOVING, MOVING)), np.zeros((13, 3, 3))
        self._products = np.zeros((2, MOVING, N))

    def doubt_phone(self, factor: float) -> None:
        """From now on the variances of the phone's samples are so many times the configured."""
        if factor == self._phone_factor:
            return
        self._phone_factor = factor
        self._noise, self._hand = noise_of(self._config), hand_of(self._config.hand)
        self._noise[1] *= sqrt(factor)
        self._hand[-1] *= sqrt(factor)

    @property
    def newest(self) -> Checkpoint:
        """Time of the last picture, or of the base [s]."""
        return self.checkpoints[-1]

    @property
    def complete(self) -> float:
        """Both IMUs' samples have come up to this time [s]."""
        return min(self.body.newest[0], self.phone.newest[0])

    def begin(self, checkpoint: Checkpoint) -> None:
        """Start from `checkpoint`."""
        self.checkpoints = [checkpoint]
        self._spoilt_from = -inf

    def insert(self, history: ImuHistory, t: float, rate: Array, force: Array) -> bool:
        """Remember a sample of `body` or `phone`; False: it was there already."""
        i = int(np.searchsorted(history.times, t)) - BENT
        before = float(history.times[i]) if i >= 0 else -inf
        if not history.insert(t, 0, rate, force):
            return False
        self._spoilt_from = min(self._spoilt_from, before)
        return True

    def predicted(self, t: float) -> Checkpoint:
        """The filter at time `t` [s], later than the base, as if no picture had come then."""
        self._repair()
        checkpoint = Checkpoint.empty()
        checkpoint.copy(next(a for a in reversed(self.checkpoints) if a.t <= t))
        self._advance(checkpoint, t)
        return checkpoint

    def in_picture(self, checkpoint: Checkpoint) -> Array:
        """P (6, 6) of the pose in a picture stamped for `checkpoint.t`; the stamp is doubted, too.

        The pose passes at ṗ = u − ω_c × p, Ṙ = R [ω_b − Rᵀ ω_c]×.
        """
        felt, p = self._inputs(checkpoint), checkpoint.x[0:3]
        passing = np.eye(6, 7)
        passing[0:3, 6] = checkpoint.x[3:6] - cross(felt[6:9], p)
        passing[3:6, 6] = felt[0:3] - checkpoint.R.T @ felt[6:9]
        P: Array = passing @ checkpoint.P[TOUCHED[:, None], TOUCHED] @ passing.T
        return P

    def fuse(
        self, checkpoint: Checkpoint, seen: VisionMeasurement, inflation: float = 1.0
    ) -> float:
        """Fuse the rays of `seen` into what was `predicted` of its time.

        `inflation` is as in `Checkpoint`.

        Gives χ² (two degrees of freedom for each LED used); NaN: the filter can't be believed.
        """
        k = len(self.checkpoints)
        while self.checkpoints[k - 1].t > checkpoint.t:
            k -= 1
        self.checkpoints.insert(k, checkpoint)
        checkpoint.seen, checkpoint.use = seen, np.full(len(seen.rays), -1, dtype=np.int8)
        checkpoint.inflation = inflation
        chi2 = self._look(checkpoint, seen, checkpoint.use)
        self._spoilt_from = checkpoint.t
        self._repair()
        return chi2

    def _remake(self, k: int) -> None:
        """Make checkpoint k anew from the one before it."""
        checkpoint = self.checkpoints[k]
        t = checkpoint.t
        checkpoint.copy(self.checkpoints[k - 1])
        self._advance(checkpoint, t)
        if checkpoint.seen is not None and checkpoint.use is not None:
            self._look(checkpoint, checkpoint.seen, checkpoint.use)

    def _look(self, checkpoint: Checkpoint, seen: VisionMeasurement, use: Flags) -> float:
        if checkpoint.inflation != 1.0:
            checkpoint.P[:MOVING] *= sqrt(checkpoint.inflation)
            checkpoint.P[:, :MOVING] *= sqrt(checkpoint.inflation)
        rays = seen.rays
        felt = self._inputs(checkpoint)
        return float(
            fuse_rays(
                checkpoint.x,
                checkpoint.R,
                checkpoint.P,
                felt,
                self._leds_in_b[rays.led],
                rays.t + (checkpoint.x[X_OFFSET] - checkpoint.t),
                np.array(rays.tangents, dtype=np.float64, order="C"),  # compiled for such alone
                np.array(rays.covariances, dtype=np.float64, order="C"),
                self._gate,
                self._still,
                use,
            )
        )

    def _repair(self) -> None:
        """Make anew what was spoilt; the base can't be."""
        if self._spoilt_from == inf:
            return
        for k in range(1, len(self.checkpoints)):
            if self.checkpoints[k].t > self._spoilt_from:
                self._remake(k)
        if self._frontier.t > self._spoilt_from or self._frontier.t <= self.newest.t:
            self._frontier.copy(self.newest)
        self._spoilt_from = inf

    def settle(self, oldest: float) -> None:
        """Let the base follow at time `oldest` [s]: nothing from before it will be made anew."""
        self._repair()
        while len(self.checkpoints) > 1 and self.checkpoints[1].t <= oldest:
            self.checkpoints.pop(0)
        if len(self.checkpoints) == 1 and self.checkpoints[0].t < oldest:
            self._advance(self.checkpoints[0], oldest)
            self.checkpoints[0].seen = self.checkpoints[0].use = None
        if self._frontier.t < self.newest.t:
            self._frontier.copy(self.newest)
        for history in (self.body, self.phone):
            kept = int(np.searchsorted(history.times, self.checkpoints[0].t, side="right")) - KEPT
            if kept > 0:
                history.forget_until(float(history.times[kept - 1]))

    def to_now(self, t: float) -> bool:
        """Bring `now` to time `t` [s]; False: the filter can't be believed."""
        self._repair()
        if self._frontier.t > t:
            self._frontier.copy(self.newest)
        complete = min(self.complete, t)
        if complete > self._frontier.t:
            self._advance(self._frontier, complete)
        self.now.copy(self._frontier)
        self._advance(self.now, t)
        return bool(is_sound(self.now.x, self.now.R, self.now.P))

    def inputs_now(self) -> Array:
        """Inputs (12,) ω_b, f_b, ω_c, f_c at the time of `now`, biases removed [rad/s, m/s²]."""
        return self._inputs(self.now)

    def _inputs(self, checkpoint: Checkpoint) -> Array:
        body, phone = self.body, self.phone
        return np.asarray(
            inputs_at(
                checkpoint.t,
                checkpoint.x,
                body.times,
                body.values,
                phone.times,
                phone.values,
                self._hand,
            )
        )

    def _advance(self, checkpoint: Checkpoint, t: float) -> None:
        body, phone = self.body, self.phone
        transit(
            checkpoint.x,
            checkpoint.R,
            checkpoint.R_ic,
            self._F,
            self._G,
            self._Q,
            (checkpoint.t, t),
            body.times,
            body.values,
            phone.times,
            phone.values,
            self._noise,
            self._hand,
            self._steps,
        )
        apply(
            checkpoint.P, self._F, self._G, self._Q, self._walks, t - checkpoint.t, self._products
        )
        checkpoint.t = t
