"""A motion sensor that says the same again and again is broken: a body in flight never rests."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.signals import BodyImu

FROZEN_S: Final = 0.1
"""Noise of the quietest sensor changes one of six numbers within a few samples; one that is read
more often than it measures repeats itself for less."""


class FrozenImu:
    """Since when the robot's samples are one and the same."""

    def __init__(self) -> None:
        """Begin before the first sample."""
        self._last: BodyImu | None = None
        self._t_changed = 0.0

    def add(self, sample: BodyImu) -> None:
        """Compare with the sample before."""
        last = self._last
        if (
            last is None
            or not np.array_equal(last.omega_m_bf_in_b, sample.omega_m_bf_in_b)
            or not np.array_equal(last.a_m_bf_in_b, sample.a_m_bf_in_b)
        ):
            self._t_changed = sample.t
        self._last = sample

    @property
    def is_frozen(self) -> bool:
        """Whether the samples have been the same for too long."""
        return self._last is not None and self._last.t - self._t_changed >= FROZEN_S
