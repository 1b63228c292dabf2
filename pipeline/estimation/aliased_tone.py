"""A vibration at about a multiple of the robot's sample rate: felt as a slow motion, and none.

No low pass after sampling tells it from a motion; pictures do. A line that samples and pictures'
misses share (`shared_line`) is tried: its amplitudes join the filter's state, a cosine and a sine
about each axis of both sensors, as biases that swing (an internal model of the disturbance;
Johnson, IEEE Trans. Automatic Control 16 (1971) 635). Of a motion nothing is left in them, and they
go again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.estimation.shared_line import LEAST, SharedLines
from pipeline.frames import Array

EVERY_S: Final = 0.5
"""How often one is sought, or its frequency followed."""
TRIAL_S, TRIAL_CYCLES = 1.5, 1.5
"""Until a trial is judged, at least."""
SURE: Final = 4.0
"""χ² of six amplitudes by their number: by chance once in two thousand."""
WANDERS: Final = 0.1
"""Share of its size by which an amplitude changes in a second."""
GONE_S: Final = 3.0
"""Not sure for so long: it is over."""
SLOWEST_HZ, FASTER_HZ = 0.15, 12.0
"""One that seems to be slower, or faster, by being followed is none."""
SHARE: Final = 0.5
"""Of what its frequency seems to be off is corrected at once."""
OF: Final = tuple(np.r_[k : k + 3, k + 6 : k + 9] for k in (0, 3))
"""Amplitudes of gyroscope and accelerometer."""
SCALE: Final = np.repeat(1.0 / np.square(LEAST), 3)
"""By which gyroscope and accelerometer are compared."""


@dataclass(frozen=True, slots=True)
class Tone:
    """What the filter's state has amplitudes of."""

    hz: float
    """As it comes after sampling."""
    t_0: float
    """When its phase is nought [s]."""
    sizes: tuple[float, float]
    """How large it may be [rad/s, m/s²]."""

    @property
    def key(self) -> tuple[float, float]:
        """As `relative_kernels.transit` takes it."""
        return 2.0 * pi * self.hz, self.t_0

    def turned(self, t: float, rate: float) -> Tone:
        """Faster by `rate` [rad/s], with the same phase at `t` [s]."""
        hz = self.hz + rate / (2.0 * pi)
        return replace(self, hz=hz, t_0=t - (t - self.t_0) * self.hz / hz)


class AliasedTone:
    """Watches the robot's samples beside what pictures are off."""

    def __init__(self) -> None:
        """Nothing felt."""
        self.tone: Tone | None = None
        """In the filter's state, be it for trial."""
        self.t_sure = np.full(2, -np.inf)
        """When gyroscope and accelerometer were last sure to have it [s]."""
        self._lines = SharedLines()
        self._t_look = self._t_tried = -np.inf
        self._before: npt.NDArray[np.complex128] | None = None

    def feel(self, t: float, rate: Array, force: Array) -> None:
        """Take a sample (3,), (3,) of the robot."""
        self._lines.feel(t, rate, force)

    def miss(self, t: float, e: Array, *, walks: bool) -> None:
        """Take by how much a picture of `t` [s] is off the pose predicted for it (6,).

        `walks`: biases seem to. Of a slow tone they take so much that pictures are off by little.
        """
        self._lines.miss(t, e)
        if self.tone is not None or t - self._t_look < EVERY_S:
            return
        self._t_look = t
        line = self._lines.find(t, felt_alone=walks)
        if line is not None:
            rate, force = np.maximum(line.sizes, 0.1 * LEAST).tolist()  # exact sensors have none
            self.tone = Tone(line.hz, t, (rate, force))
            self._t_tried, self._before = t, None

    def judge(self, t: float, z: Array, P: Array) -> None:
        """Is it there, by its amplitudes (12,) and their covariance (12, 12) at `t` [s]?"""
        if self.tone is None:
            return
        if not SLOWEST_HZ <= self.tone.hz <= FASTER_HZ:
            self._give_up(t, self.tone)
            return
        judged = self._t_tried + max(TRIAL_S, TRIAL_CYCLES / self.tone.hz)
        for sensor, own in enumerate(OF):
            size = float(np.sqrt(z[own] @ z[own]))
            chi2 = float(z[own] @ np.linalg.solve(P[np.ix_(own, own)], z[own])) / len(own)
            if chi2 > SURE and size > LEAST[sensor] and t > judged:
                self.t_sure[sensor] = t
        if t > judged and t - float(self.t_sure.max()) > GONE_S:
            self._give_up(t, self.tone)
        elif t - self._t_look >= EVERY_S:
            self._follow(self.tone, t, z)

    def _give_up(self, t: float, tone: Tone) -> None:
        self._lines.tried_in_vain(t, tone.hz)
        self.tone = None

    def _follow(self, tone: Tone, t: float, z: Array) -> None:
        """Amplitudes that turn on tell of another frequency."""
        before, now = self._before, z[:6] - 1j * z[6:]
        if before is not None:
            rate = float(np.angle(np.vdot(before, SCALE * now))) / (t - self._t_look)
            self.tone = tone.turned(t, SHARE * rate)
        self._before, self._t_look = now, t
