"""PID gains: the paper's Table II, and a softer set for a phone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array


def _row(*values: float) -> Array:
    row = np.array(values, dtype=np.float64)
    row.setflags(write=False)
    return row


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """Diagonals over (x, y, z, roll, pitch, yaw): N/m, N/(m s), N s/m; N m/rad and so on."""

    Kp: Array
    Ki: Array
    Kd: Array


TABLE_II_WITH_EKF = Gains(  # Table II (a)
    Kp=_row(100.0, 100.0, 200.0, 5.0, 5.0, 5.0),
    Ki=_row(150.0, 150.0, 300.0, 20.0, 20.0, 20.0),
    Kd=_row(30.0, 30.0, 30.0, 1.0, 1.0, 2.0),
)
TABLE_II_WITHOUT_EKF = Gains(  # Table II (b)
    Kp=_row(30.0, 50.0, 100.0, 5.0, 5.0, 2.0),
    Ki=_row(90.0, 150.0, 200.0, 15.0, 15.0, 5.0),
    Kd=_row(10.0, 15.0, 15.0, 0.5, 0.5, 1.0),
)
PHONE = Gains(  # for pictures 60-120 ms old, see `lightleash experiments loop`, `margins`
    Kp=_row(80.0, 80.0, 120.0, 5.0, 5.0, 6.0),
    Ki=_row(90.0, 90.0, 150.0, 12.0, 12.0, 15.0),
    Kd=_row(30.0, 30.0, 30.0, 0.7, 0.7, 1.3),
)
