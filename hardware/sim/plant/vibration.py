"""What propellers shake a robot's motion sensors by, with its truth."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin
from typing import Final

import numpy as np

from pipeline.frames import Array

IDLE_N: Final = 0.05
"""Thrust from which on a propeller shakes anything."""


@dataclass(frozen=True, slots=True)
class Vibration:
    """Of the body's sensors, which no low pass keeps out before they are sampled."""

    hz: float
    """Beside a multiple of the sample rate it comes as a slow motion."""
    rate: float = 0.0
    """Amplitude of the gyroscope, along any axis [rad/s]."""
    force: float = 0.0
    """Of the accelerometer, along another [m/s²]."""
    start_s: float = 0.0
    spins: bool = True
    """Only while a thruster gives thrust."""


class Shaking:
    """One robot's."""

    def __init__(self, vibration: Vibration, rng: np.random.Generator) -> None:
        """Along axes and with phases of `rng`."""
        self._vibration = vibration
        axes = rng.standard_normal((2, 3))
        self._axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        self._phases: list[float] = rng.uniform(0.0, 2.0 * pi, 2).tolist()

    def added(self, t: float, thrusts: Array) -> tuple[Array, Array]:
        """To rate (3,) [rad/s] and specific force (3,) [m/s²] in b at `t` [s], giving `thrusts`."""
        v = self._vibration
        shakes = t >= v.start_s and (not v.spins or float(thrusts.max(initial=0.0)) > IDLE_N)
        waves = [sin(2.0 * pi * v.hz * t + phase) * shakes for phase in self._phases]
        return v.rate * waves[0] * self._axes[0], v.force * waves[1] * self._axes[1]
