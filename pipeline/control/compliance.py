"""Compliance: against an obstacle the robot pushes no harder than it may, and does not bounce.

The force that PID and feed-forward ask for is cut where it exceeds, by more than the limit, what
has held the robot lately. PID's anti-windup is told what was cut, so its integral gives way as if
the reference had: the robot pushes with the limit however far the reference lies behind the
obstacle, lets go as soon as the reference turns back, and goes there slowly when the obstacle goes.

Only the slow part of the damping is cut. The quick part is what takes the energy out of an impact;
without it the robot would bounce on a constant force like a ball.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.config import ComplianceConfig
from pipeline.frames import Array

FREE = 0.5
"""Pushing with less than this share of the limit is nothing unusual: what holds it is learnt."""


class Compliance:
    """Call `force` every period of tracking; `on` may change at any time, without a jump."""

    def __init__(self, config: ComplianceConfig) -> None:
        """On or off as configured."""
        self._config = config
        self.on = config.enabled
        self.start(np.zeros(3))

    def start(self, force_in_f: Array) -> None:
        """Tracking starts from a force that holds the robot (3,) [N]."""
        self._usual_in_f = force_in_f
        self._damping_in_f = np.zeros(3)
        self._limit = self._config.limit_n if self.on else np.inf
        self.yields = False
        """Whether the last force was cut."""

    def force(self, force_in_f: Array, damping_in_f: Array, h: float) -> Array:
        """What of a force is to be given (3,) [N].

        Args:
            force_in_f: That PID and feed-forward ask for (3,) [N].
            damping_in_f: What of it answers to the error's rate (3,) [N].
            h: Since the last call [s].
        """
        c = self._config
        self._damping_in_f = self._damping_in_f + h / c.quick_s * (
            damping_in_f - self._damping_in_f
        )
        quick_in_f = damping_in_f - self._damping_in_f
        push_in_f = force_in_f - quick_in_f - self._usual_in_f
        push = sqrt(float(push_in_f @ push_in_f))
        self._limit = self._next_limit(push, h)
        self.yields = push > self._limit
        if self.yields:
            return self._usual_in_f + self._limit / push * push_in_f + quick_in_f
        if push < FREE * c.limit_n:
            self._usual_in_f = self._usual_in_f + h / c.usual_s * push_in_f
        return force_in_f

    def _next_limit(self, push: float, h: float) -> float:
        """Switched on, it comes down from what is pushed now; off, it rises until all is given."""
        ease = self._config.ease_n_s * h
        if not self.on:
            return np.inf if push <= self._limit else self._limit + ease
        return max(self._config.limit_n, min(self._limit, push) - ease)
