"""Which way is up for a motion sensor, and how it turns, at any time of its stream."""

from __future__ import annotations

from typing import NamedTuple

from pipeline.estimation.gravity_direction import GravityDirection
from pipeline.frames import Array
from pipeline.imu_stream import ImuStream

STALE_S = 0.3
"""Farther from the nearest sample nothing is known."""


class BufferedImu(NamedTuple):
    """Gravity direction and angular rate at one time."""

    up: Array | None
    """Opposite of gravity (3,) in the sensor's axes."""
    omega: Array
    """(3,) [rad/s]."""


class ImuBuffer:
    """A stream, and gravity by its newest sample."""

    def __init__(self, stream: ImuStream) -> None:
        """Begin with an empty `stream`, to be filled here alone."""
        self._stream, self._gravity_direction = stream, GravityDirection()

    def add(self, t: float, omega: Array, specific_force: Array) -> None:
        """Take a sample of `t` [s]: `omega` (3,) [rad/s], `specific_force` (3,) [m/s²]."""
        if t > self._stream.newest:
            self._gravity_direction.add(t, omega, specific_force)
        self._stream.insert(t, omega, specific_force)

    def at(self, t: float) -> BufferedImu | None:
        """At `t` [s], beyond the samples as at the nearest; None if all are far.

        Gravity is that of the newest sample, turned back as the gyroscope turned since.
        """
        stream, up = self._stream, self._gravity_direction.up
        oldest, newest = stream.oldest, stream.newest
        if not oldest - STALE_S <= t <= newest + STALE_S:
            return None
        t = min(max(t, oldest), newest)
        back = None if up is None else stream.turn(t, newest) @ up
        return BufferedImu(back, stream.at(t)[:3])
