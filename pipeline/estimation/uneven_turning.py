"""Whether phone or robot turns unevenly, as whatever is held or flies does, and nothing at rest.

A single sample's noise can say anything if one waits for long: what is compared are means, the
angles turned in times long enough for noise to average out. A bias is in all of them.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu

UNEVEN_RAD_S: Final = 0.03
"""By how much a mean rate changes in a hand or in flight, and by no gyroscope's noise or bias: of
noise of 0.005 rad/s, which is much, an hour at rest makes 0.022."""
MEAN_S: Final = 0.05
"""Three samples of a phone, half a period of a tremor of 10 Hz."""
COMPARED: Final = 6
"""Means in a row, of 0.3 s."""


class MeanRates:
    """What one gyroscope said lately, in means over `MEAN_S`."""

    def __init__(self) -> None:
        """Nothing heard."""
        self._t, self._samples = np.inf, list[Array]()
        self._means: deque[Array] = deque(maxlen=COMPARED)

    def add(self, t: float, omega: Array) -> bool:
        """Take a rate (3,) [rad/s] of `t` [s]; whether a mean became complete."""
        is_complete = abs(t - self._t) >= MEAN_S and len(self._samples) > 0
        if is_complete:
            self._means.append(np.mean(self._samples, axis=0))
            self._samples.clear()
        if not self._samples:
            self._t = t
        self._samples.append(omega)
        return is_complete

    def are_uneven(self, newest: int = COMPARED) -> bool:
        """Whether the `newest` means differ by more than noise."""
        means = list(self._means)[-newest:] if newest > 0 else []
        return len(means) > 1 and float(np.ptp(means, axis=0).max()) > UNEVEN_RAD_S


class UnevenTurning:
    """Of phone and robot: lately, and since something was first seen."""

    def __init__(self) -> None:
        """No samples yet."""
        self._sides: dict[type, MeanRates] = {PhoneImu: MeanRates(), BodyImu: MeanRates()}
        self._since: dict[type, int] = {}
        self._was_uneven = False

    def add_imu(self, sample: PhoneImu | BodyImu) -> None:
        """Take a sample of either side."""
        omega = sample.omega_m_cf_in_c if isinstance(sample, PhoneImu) else sample.omega_m_bf_in_b
        side = type(sample)
        if self._sides[side].add(sample.t, omega):
            since = self._since[side] = self._since.get(side, -1) + 1
            self._was_uneven |= self._sides[side].are_uneven(min(since, COMPARED))

    def begin(self) -> None:
        """See something for the first time; the mean that is not complete is of before, too."""
        self._since.clear()
        self._was_uneven = False

    @property
    def is_detected(self) -> bool:
        """Whether either side turns unevenly, or did since `begin`."""
        return self._was_uneven or any(side.are_uneven() for side in self._sides.values())
