"""Compliance: against an obstacle the robot pushes no harder than it may, and does not bounce.

The force that PID and feed-forward ask for is cut where it exceeds, by more than the limit, what
has held the robot lately. PID's anti-windup is told what was cut, so its integral gives way as if
the reference had: the robot pushes with the limit however far the reference lies behind the
obstacle, lets go as soon as the reference turns back, and goes there slowly when the obstacle goes.

Where it follows its reference nothing blocks it, and what it takes to carry it about (a
suspension's pull, its own inertia) is no push: as much as the limit again is let through. That
fades as soon as it stays behind. Only the error tells: how far the suspension is drawn out can't be
had from accelerometers, since 0.02 m/s² of tilt and bias, integrated twice above 0.1 Hz, are worth
more than its whole pull. So a reference that lies less than `follows_m` behind an obstacle may push
with twice the limit.

What the damping answers to the body's own quick motion is not cut: it takes the energy out of an
impact; without it the robot would bounce on a constant force like a ball. The body's own, as its
accelerometer feels it: the error's rate also has the hand's tremor, which must not reach the wall.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.config import ComplianceConfig
from pipeline.frames import Array

FREE = 0.5
"""Pushing with less than this share of the limit is nothing unusual: what holds it is learnt."""
SLOW_S = 0.5
"""What the accelerometer says for longer is no motion."""


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
        self._carried_in_f = self._quick_in_f = np.zeros(3)
        self._slow_in_f: Array | None = None
        self._limit = self._config.limit_n if self.on else np.inf
        self.yields = False
        """Whether the last force was cut."""

    def force(self, force_in_f: Array, braking_in_f: Array, behind: float, h: float) -> Array:
        """What of a force is to be given (3,) [N].

        Args:
            force_in_f: That PID and feed-forward ask for (3,) [N].
            braking_in_f: Damping times what the body is felt to slow down with (3,) [N/s].
            behind: Distance from the body to its reference [m].
            h: Since the last call [s].
        """
        c = self._config
        quick_in_f = self._brake(braking_in_f, h)
        push_in_f = force_in_f - quick_in_f - self._usual_in_f
        self._carry(push_in_f, behind < c.follows_m, h)
        beyond_in_f = push_in_f - self._carried_in_f
        push = _norm(beyond_in_f)
        self._limit = self._next_limit(push, h)
        self.yields = push > self._limit
        if self.yields:
            given_in_f = self._carried_in_f + self._limit / push * beyond_in_f
            return self._usual_in_f + given_in_f + quick_in_f
        if _norm(push_in_f) < FREE * c.limit_n:
            self._usual_in_f = self._usual_in_f + h / c.usual_s * push_in_f
        return force_in_f

    def _brake(self, braking_in_f: Array, h: float) -> Array:
        """Of the body's own quick motion; what lasts is the accelerometer's bias, and a tilt's."""
        slow = braking_in_f if self._slow_in_f is None else self._slow_in_f
        self._slow_in_f = slow + h / SLOW_S * (braking_in_f - slow)
        quick = self._quick_in_f
        rate_in_f = braking_in_f - self._slow_in_f - quick / self._config.quick_s
        self._quick_in_f = quick + h * rate_in_f
        return self._quick_in_f

    def _carry(self, push_in_f: Array, follows: bool, h: float) -> None:
        """Learn what it takes where the robot follows; forget it where it stays behind."""
        c = self._config
        goal_in_f = _within(c.limit_n, push_in_f) if follows else np.zeros(3)
        share = h / (c.carried_s if follows else c.blocked_s)
        self._carried_in_f = self._carried_in_f + share * (goal_in_f - self._carried_in_f)

    def _next_limit(self, push: float, h: float) -> float:
        """Switched on, it comes down from what is pushed now; off, it rises until all is given."""
        ease = self._config.ease_n_s * h
        if not self.on:
            return np.inf if push <= self._limit else self._limit + ease
        return max(self._config.limit_n, min(self._limit, push) - ease)


def _norm(vector: Array) -> float:
    return sqrt(float(vector @ vector))


def _within(most: float, vector: Array) -> Array:
    """The same direction, no longer than `most`."""
    length = _norm(vector)
    return vector if length <= most else most / length * vector
