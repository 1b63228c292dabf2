"""One flight as it was recorded, and the same on one even grid of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pipeline.config import PERIOD_S
from pipeline.frames import Array

LEAST_S: Final = 12.0
"""Shorter, and the filters' ends leave too little."""


@dataclass(frozen=True, slots=True, eq=False)
class FlightRecord:
    """A stretch of a flight without a gap; times [s] ascend, each thing has its own."""

    t_command: Array
    """(n,) [s]."""
    commands: Array
    """(n, m) thrusts that were commanded then, held until the next [N]."""
    t_imu: Array
    """(k,) [s]."""
    omega_in_b: Array
    """(k, 3) angular rate [rad/s]."""
    force_in_b: Array
    """(k, 3) specific force [m/s²]."""
    t_attitude: Array
    """(a,) [s]."""
    R_fb: Array
    """(a, 3, 3) estimated attitude; its yaw may be any."""

    @property
    def seconds(self) -> float:
        """How long all of it is known."""
        begin, end = self.span
        return max(0.0, end - begin)

    @property
    def span(self) -> tuple[float, float]:
        """From when to when [s]."""
        series = (self.t_command, self.t_imu, self.t_attitude)
        return max(float(t[0]) for t in series), min(float(t[-1]) for t in series)


@dataclass(frozen=True, slots=True, eq=False)
class SampledFlight:
    """A flight each `PERIOD_S`."""

    commands: Array
    """(n, m) [N]."""
    omega_in_b: Array
    """(n, 3) [rad/s]."""
    force_in_b: Array
    """(n, 3) [m/s²]."""
    R_fb: Array
    """(n, 3, 3)."""

    @classmethod
    def of(cls, record: FlightRecord) -> SampledFlight:
        """Resample: commands as if control had kept its schedule, the others between samples.

        Commands that are farther apart than a period, as older recordings have them, are joined by
        straight lines: held, they would be late by half of their period.
        """
        t = np.arange(*record.span, PERIOD_S)
        return cls(
            np.column_stack(
                [np.interp(t, record.t_command, column) for column in record.commands.T]
            ),
            np.column_stack([np.interp(t, record.t_imu, column) for column in record.omega_in_b.T]),
            np.column_stack([np.interp(t, record.t_imu, column) for column in record.force_in_b.T]),
            Slerp(record.t_attitude, Rotation.from_matrix(record.R_fb))(t).as_matrix(),
        )
