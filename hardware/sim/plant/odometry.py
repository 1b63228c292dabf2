"""What a simulated robot without motion sensors measures of its own twist: now and then, and late.

It is that of its wheels or joints; the body's may be another (`TwistPlant`).
"""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

from hardware.plant_parameters import OdometryParameters
from pipeline.frames import Array


class Odometry:
    """Deterministic for a seed of `rng`. Times are [µs]."""

    def __init__(
        self, parameters: OdometryParameters, axes: npt.NDArray[np.bool_], rng: np.random.Generator
    ) -> None:
        """Nothing measured yet; of `axes` (6,) along and about which it goes."""
        self._parameters, self._free, self._rng = parameters, axes, rng
        self._interval_us = round(1e6 * parameters.interval_s)
        self._latency_us = round(1e6 * parameters.latency_s)
        self._due_us = 0
        self._measured: deque[tuple[int, Array]] = deque([(0, np.zeros(6))])
        """On their way, and before them the one that is told: (when, twist)."""

    def read(self, now_us: int, twist_in_b: Array) -> tuple[Array, float]:
        """Twist (6,) that is told now, and its age [s]; the wheels' is `twist_in_b` now."""
        if now_us >= self._due_us:
            self._due_us += self._interval_us
            self._measured.append((now_us, self._measure(twist_in_b)))
        while len(self._measured) > 1 and self._measured[1][0] + self._latency_us <= now_us:
            self._measured.popleft()
        t_us, told = self._measured[0]
        return told, 1e-6 * (now_us - t_us)

    def _measure(self, twist_in_b: Array) -> Array:
        sigmas = np.repeat((self._parameters.noise_v, self._parameters.noise_omega), 3)
        noisy: Array = twist_in_b + self._free * sigmas * self._rng.normal(size=6)
        return noisy
