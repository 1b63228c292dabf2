"""Dates of pictures that are each off by a little: how much, learnt from how late pictures seem.

Where a camera's driver does not say when it exposed, a browser says when it heard of the picture:
some milliseconds beside, each time others. While phone and robot turn, that is many times what
vision is unsure of. Fused as it is, each picture pulls at speeds and biases; sensors are doubted
for it, or LEDs refused. So how late the errors e (6,) of covariance S say that a picture is, along
the pose's own motion a alone,

    late = aᵀ S⁻¹ e / aᵀ S⁻¹ a    of variance 1 / aᵀ S⁻¹ a,

is compared with that of the picture before (covariance matching, as in `adaptive_noise`): what both
are late by is the time offset's. What is off across the motion as well is no date's doing, and
counts against it.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, inf, isfinite, log
from typing import Final

import numpy as np

from pipeline.estimation.believed_less import widened_rays
from pipeline.estimation.innovation_kernels import lateness
from pipeline.frames import Array
from pipeline.signals import VisionMeasurement

GAIN: Final = 0.2
"""Of the variance's logarithm, for each picture that is off by one standard deviation too much."""
LEAST_S, FIRST_S, MOST_S = 0.0004, 0.002, 0.02
"""Standard deviations: less is not told from right dates, so much is believed of a camera that
nobody knows, more is no noise."""
TOLERATED_S: Final = 0.0006
"""Up to there nothing is doubted."""
SURPRISE: Final = 9.0
"""A square that is more times what was expected counts as this."""


class DateNoise:
    """How far each picture's date is off by itself, beside what all of them are off by."""

    def __init__(self) -> None:
        """Of a camera that nobody knows."""
        self._log = log(FIRST_S)
        self._before = 0.0, inf
        """How late the picture before was [s], its variance, were its own date right."""

    @property
    def sigma_s(self) -> float:
        """Standard deviation of one date [s]; 0: too small to tell."""
        sigma_s = exp(self._log)
        return sigma_s if sigma_s > TOLERATED_S else 0.0

    def learn(self, e: Array, S: Array, passing: Array) -> None:
        """Learn from a picture whose pose is off what was predicted.

        Args:
            e: (6,) by how much: δp in c [m], θ in b [rad].
            S: (6, 6) covariance of that, were its own date right.
            passing: (6,) how the predicted pose passes: ṗ in c [m/s], attitude in b [rad/s].
        """
        late_s, information, across = lateness(e, S, passing)
        if not information > 0.0 or not isfinite(late_s):
            return
        across /= len(e) - 1.0
        known = max(1.0, across) / information
        (before_s, known_before), self._before = self._before, (late_s, known)
        own, known = exp(2.0 * self._log), 0.5 * (known + known_before)
        ratio = 0.5 * (late_s - before_s) ** 2 / (known + own)
        step = 0.5 * GAIN * own / (known + own) * (min(ratio, SURPRISE) - 1.0)
        self._log = min(max(self._log + step, log(LEAST_S)), log(MOST_S))

    def inflated(
        self,
        seen: VisionMeasurement,
        leds_in_b: Array,
        p_bc_in_c: Array,
        R_cb: Array,
        passing: Array,
    ) -> VisionMeasurement:
        """The same picture, less sure along its motion.

        Args:
            seen: With a pose or without one.
            leds_in_b: (n, 3) [m].
            p_bc_in_c: (3,) where it was predicted [m].
            R_cb: (3, 3) and how turned.
            passing: As of `learn`.
        """
        sigma_s, pose = self.sigma_s, seen.pose
        if sigma_s == 0.0:
            return seen
        off = sigma_s * passing
        rays = widened_rays(p_bc_in_c, R_cb, seen.rays, leds_in_b, off[:3], off[3:])
        if pose is not None:
            pose = replace(pose, covariance=pose.covariance + np.outer(off, off))
        return replace(seen, pose=pose, rays=rays)
