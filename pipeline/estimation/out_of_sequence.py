"""A filter on the time axis: what arrives late is fused at the moment it was taken.

    base ── picture ── picture ── … ── frontier ── now

A `Checkpoint` is the filter right after a picture. What arrives late (a picture between two others,
an IMU sample that was held or interpolated over) spoils the checkpoints after it; they are made
anew from the last good one, with the decisions on outliers they were made with. The *frontier* is
as far as both IMUs' samples reach; from there to now the newest samples are held, with growing
doubt.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import pairwise
from math import inf, sqrt
from typing import Generic, TypeVar

import numpy as np

from pipeline.frames import Array
from pipeline.imu_stream import ImuStream
from pipeline.signals import Flags

Measurement = TypeVar("Measurement")


@dataclass(slots=True, eq=False)
class Checkpoint(Generic[Measurement]):
    """The filter at one time, as a rule right after a picture."""

    t: float
    x: Array
    """(n,) state."""
    R: Array
    """(3, 3) attitude R_cb, for a filter that has none in x."""
    P: Array
    """(m, m) covariance of the error state."""
    R_ic: Array
    """(3, 3) rotation of the camera since the phone's last sample."""
    seen: Measurement | None = None
    """The picture that was fused here."""
    use: Flags | None = None
    """Which parts of it were: −1 is yet to be decided, 0 left out, 1 fused."""
    inflation: float = 1.0
    """Factor of the variances of place, velocity and attitude that were predicted for it."""
    opened: Array | None = None
    """(m,) variances by which the error state is known worse than was predicted for it."""

    @classmethod
    def empty(cls, states: int, errors: int) -> Checkpoint[Measurement]:
        """Memory for a checkpoint; its content has no meaning yet."""
        return cls(-inf, np.zeros(states), np.eye(3), np.zeros((errors, errors)), np.eye(3))

    def copy(self, other: Checkpoint[Measurement]) -> None:
        """Become like `other`, its picture aside."""
        self.t = other.t
        self.x[:], self.R[:], self.P[:] = other.x, other.R, other.P
        self.R_ic[:] = other.R_ic


class OutOfSequence(ABC, Generic[Measurement]):
    """State and covariance at any time between the base and now."""

    def __init__(self, states: int, errors: int, moving: int, bent: int, kept: int) -> None:
        """Begin without meaning: call `begin` before anything but `insert`.

        Args:
            states: Length of x.
            errors: Length of the error state.
            moving: The first so many of it can be inflated.
            bent: Samples before a new one from which on it changes what lies between samples.
            kept: Samples up to the base that are still interpolated and extrapolated from.
        """
        self._sizes, self._moving, self._bent, self._kept = (states, errors), moving, bent, kept
        self.body, self.phone = ImuStream(), ImuStream()
        self.checkpoints = [self._empty()]
        self.now, self._frontier = self._empty(), self._empty()
        self._replay_from = -inf
        """Checkpoints and frontier after this time [s] are to be replayed; inf: none."""

    def _empty(self) -> Checkpoint[Measurement]:
        return Checkpoint.empty(*self._sizes)

    @abstractmethod
    def _advance(self, here: Checkpoint[Measurement], t: float) -> None:
        """Carry `here` on to time `t` [s] by the samples in between."""

    @abstractmethod
    def _fuse(self, here: Checkpoint[Measurement], seen: Measurement, use: Flags) -> float:
        """Fuse a picture at its time: what `use` says, deciding what is undecided; gives χ²."""

    @abstractmethod
    def _is_sound(self, here: Checkpoint[Measurement]) -> bool:
        """Whether it can be believed."""

    @property
    def base(self) -> Checkpoint[Measurement]:
        """Whatever was taken before it comes too late."""
        return self.checkpoints[0]

    @property
    def newest(self) -> Checkpoint[Measurement]:
        """Of the last picture, or the base."""
        return self.checkpoints[-1]

    @property
    def complete(self) -> float:
        """Both IMUs' samples have come up to this time [s]."""
        return min(self.body.newest, self.phone.newest)

    def begin(self, start: Checkpoint[Measurement]) -> None:
        """Start from there."""
        self.checkpoints = [start]
        self._replay_from = -inf

    def insert(
        self, stream: ImuStream, t: float, rate: Array, force: Array, more: Array | None = None
    ) -> bool:
        """Remember a sample of `body` or `phone`; False: it was there already."""
        times = stream.times
        i = (len(times) if t > stream.newest else int(np.searchsorted(times, t))) - self._bent
        before = float(times[i]) if i >= 0 else -inf
        if not stream.insert(t, rate, force, more):
            return False
        self._replay_from = min(self._replay_from, before)
        return True

    def predicted(self, t: float, without: float = inf) -> Checkpoint[Measurement]:
        """The filter at time `t` [s], not before the base, as if no picture had come then.

        Nor any after `without` [s], the base aside.
        """
        self._repair()
        here, last = self._empty(), min(t, without)
        known = (past for past in reversed(self.checkpoints) if past.t <= last)
        here.copy(next(known, self.base))
        self._advance(here, t)
        return here

    def fuse(
        self,
        here: Checkpoint[Measurement],
        seen: Measurement,
        parts: int,
        inflation: float = 1.0,
    ) -> float:
        """Fuse a picture of so many parts into what was `predicted` for its time.

        Gives χ² of the parts used; NaN: the filter can't be believed.
        """
        k = len(self.checkpoints)
        while self.checkpoints[k - 1].t > here.t:
            k -= 1
        self.checkpoints.insert(k, here)
        here.seen, here.use = seen, np.full(parts, -1, dtype=np.int8)
        here.inflation = inflation
        chi2 = self._look(here, seen, here.use)
        self._replay_from = here.t
        self._repair()
        return chi2

    def _look(self, here: Checkpoint[Measurement], seen: Measurement, use: Flags) -> float:
        if here.inflation != 1.0:
            here.P[: self._moving] *= sqrt(here.inflation)
            here.P[:, : self._moving] *= sqrt(here.inflation)
        if here.opened is not None:
            np.fill_diagonal(here.P, here.P.diagonal() + here.opened)
        return self._fuse(here, seen, use)

    def open(self, variances: Array) -> None:
        """Let the error state have moved by `variances` (m,) meanwhile, bit by bit since the base.

        What was fused since then is fused anew.
        """
        since = self.checkpoints[1:]
        for here in since:
            more = variances / len(since)
            here.opened = more if here.opened is None else here.opened + more
        self._replay_from = min(self._replay_from, self.base.t)
        self._repair()

    def _repair(self) -> None:
        """Replay what a late sample or picture changes; the base can't be."""
        if self._replay_from == inf:
            return
        k = len(self.checkpoints)
        while k > 1 and self.checkpoints[k - 1].t > self._replay_from:
            k -= 1
        for before, here in pairwise(self.checkpoints[k - 1 :]):
            t = here.t
            here.copy(before)
            self._advance(here, t)
            if here.seen is not None and here.use is not None:
                self._look(here, here.seen, here.use)
        if self._frontier.t > self._replay_from or self._frontier.t <= self.newest.t:
            self._frontier.copy(self.newest)
        self._replay_from = inf

    def settle(self, oldest: float) -> None:
        """Let the base follow at time `oldest` [s]: nothing from before it will be made anew."""
        self._repair()
        before = self.base.t
        while len(self.checkpoints) > 1 and self.checkpoints[1].t <= oldest:
            self.checkpoints.pop(0)
        if len(self.checkpoints) == 1 and self.base.t < oldest:
            self._advance(self.base, oldest)
            self.base.seen = self.base.use = None
        if self._frontier.t < self.newest.t:
            self._frontier.copy(self.newest)
        if self.base.t == before:
            return
        for stream in (self.body, self.phone):
            kept = int(np.searchsorted(stream.times, self.base.t, side="right")) - self._kept
            if kept > 0:
                stream.forget_until(float(stream.times[kept - 1]))

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
        return self._is_sound(self.now)
