"""IMU buffer: gravity direction and angular rate at any time of the last half second."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.estimation.gravity_direction import GravityDirection
from pipeline.frames import Array

REMEMBERED_S = 0.6
MAX_REMEMBERED = 1024
STALE_S = 0.3
"""Farther from the nearest sample nothing is known."""


class BufferedImu(NamedTuple):
    """Gravity direction and angular rate at one time."""

    t: float
    """[s]."""
    up: Array | None
    """Opposite of gravity (3,) in the sensor's axes."""
    omega: Array
    """(3,) [rad/s]."""


class ImuBuffer:
    """Samples come in the order of time, from one thread; any thread may ask."""

    def __init__(self) -> None:
        """Begin without a sample."""
        self._gravity_direction = GravityDirection()
        self._samples: tuple[BufferedImu, ...] = ()

    def add(self, t: float, omega: Array, specific_force: Array) -> None:
        """Take a sample of `t` [s]: `omega` (3,) [rad/s], `specific_force` (3,) [m/s²]."""
        self._gravity_direction.add(t, omega, specific_force)
        kept = self._samples[-MAX_REMEMBERED:]
        first = 0
        while first < len(kept) and kept[first].t < t - REMEMBERED_S:
            first += 1
        # a new tuple each time: who reads one in another thread keeps it whole
        self._samples = (*kept[first:], BufferedImu(t, self._gravity_direction.up, omega))

    def at(self, t: float) -> BufferedImu | None:
        """Interpolate the samples around `t` [s], or take the nearest; None if all are far."""
        samples = self._samples
        if not samples or not samples[0].t - STALE_S <= t <= samples[-1].t + STALE_S:
            return None
        later = len(samples)
        while later > 0 and samples[later - 1].t > t:
            later -= 1
        if later == 0:
            return samples[0]._replace(t=t)
        if later == len(samples):
            return samples[-1]._replace(t=t)
        return _between(samples[later - 1], samples[later], t)


def _between(a: BufferedImu, b: BufferedImu, t: float) -> BufferedImu:
    share = (t - a.t) / (b.t - a.t)
    omega = (1.0 - share) * a.omega + share * b.omega
    if a.up is None or b.up is None:
        return BufferedImu(t, b.up, omega)
    up = (1.0 - share) * a.up + share * b.up
    norm = float(np.sqrt(up @ up))
    return BufferedImu(t, up / norm if norm > 0.5 else b.up, omega)
