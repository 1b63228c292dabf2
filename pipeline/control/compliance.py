"""Compliance: against an obstacle the robot pushes no harder than it may, and does not bounce.

PID and feed-forward ask for a force F, which pushes with p = F - q - u beyond what has held the
robot lately, u. PID's anti-windup is told what of it was not given, so its integral gives way as if
the reference had: the robot pushes with the limit N however far the reference lies behind the
obstacle, lets go as soon as the reference turns back, and goes there slowly when the obstacle goes.

Where it follows its reference nothing blocks it, and what it takes to carry it about (a
suspension's pull, its own inertia) is no push: c, as much as N again, is let through, and p - c is
cut to the length N. Where it stays behind by more than `follows_m` it is blocked, along n, the mean
direction of its reference; c is forgotten, and what is given is

    u + c + q + n min(N, n.(L(F) - u - c)) + within(N `ACROSS`, (p - c) across n)

so what it takes to follow a hand that wanders along a wall takes no share of the push, and a
socket's sides are pressed less than its bottom. L is a low pass of tau = `quick_s`: a hand's tremor
(8 to 12 Hz; 3.5 kg on a wall of 1e4 N/m ring at 9 Hz) does not reach the wall, where in its troughs
it would take the tool off. From once to twice `follows_m` behind, and from half of N to N, the one
law goes over into the other.

q is what the damping D answers to the body's own quick motion, and is never cut: it takes the
energy out of an impact; without it the robot would bounce on a constant force like a ball. It is
the body's own v, as its accelerometer feels it, high-passed with the same tau, so that the low pass
takes no damping away: q = tau s / (tau s + 1) (-D v), and q + L(-D v) = -D v. Only the spring K e
is late by tau, which costs K tau of D at most: 8 of 30 N s/m. At the limit nothing but a constant
force and q act along n, and q only ever takes energy above 1 / (2 pi sqrt(tau `SLOW_S`)) = 0.7 Hz;
below, where the accelerometer's bias is taken off it, it gives back 0.08 D v at most.

Only the error tells that it follows: how far the suspension is drawn out can't be had from
accelerometers, since 0.02 m/s2 of tilt and bias, integrated twice above 0.1 Hz, are worth more than
its whole pull. So a reference that lies less than `follows_m` behind an obstacle may push with 2 N.
"""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np

from pipeline.config import ComplianceConfig
from pipeline.frames import Array

FREE = 0.5
"""Pushing with less than this share of the limit is nothing unusual: what holds it is learnt."""
SLOW_S = 0.5
"""What the accelerometer says for longer is no motion."""
ACROSS = 1.0 / 3.0
"""Of the limit, across what blocks it: more presses a socket's sides, less follows less along a
wall."""
AIMED_S = 1.0
"""Over which the direction of what blocks it is a mean: longer than a hand wanders to a side."""


class Compliance:
    """Call `force` every period of tracking; `on` may change at any time, without a jump."""

    def __init__(self, config: ComplianceConfig) -> None:
        """On or off as configured."""
        self._config = config
        self.on = config.enabled
        self.start(np.zeros(3))

    def start(self, force_in_f: Array) -> None:
        """Tracking starts from a force that holds the robot (3,) [N]."""
        self._usual_in_f = self._late_in_f = force_in_f
        self._carried_in_f = self._quick_in_f = np.zeros(3)
        self._behind_in_f = self._aim_in_f = np.zeros(3)
        self._slow_in_f: Array | None = None
        self._limit = self._config.limit_n if self.on else np.inf

    def force(self, force_in_f: Array, braking_in_f: Array, behind_in_f: Array, h: float) -> Array:
        """What of a force is to be given (3,) [N].

        Args:
            force_in_f: That PID and feed-forward ask for (3,) [N].
            braking_in_f: Damping times what the body is felt to slow down with (3,) [N/s].
            behind_in_f: From the body to its reference (3,) [m].
            h: Since the last call [s].
        """
        quick_in_f = self._brake(braking_in_f, h)
        push_in_f = force_in_f - quick_in_f - self._usual_in_f
        self._follow(force_in_f, behind_in_f, h)
        self._carry(push_in_f, h)
        cut_in_f = self._cut(push_in_f, h)
        if cut_in_f is not None:
            return self._usual_in_f + self._carried_in_f + cut_in_f + quick_in_f
        if _norm(push_in_f) < FREE * self._config.limit_n:
            self._usual_in_f = self._usual_in_f + h / self._config.usual_s * push_in_f
        return force_in_f

    def _cut(self, push_in_f: Array, h: float) -> Array | None:
        """What of a push beyond what carries it is given (3,) [N]; None: all, as it is."""
        beyond_in_f = push_in_f - self._carried_in_f
        late_in_f = self._late_in_f - self._usual_in_f - self._carried_in_f
        blocked = self._blocked(late_in_f)
        n = self._along(beyond_in_f, blocked)
        ahead = float(beyond_in_f @ n)
        across_in_f = beyond_in_f - ahead * n
        ahead += blocked * (float(late_in_f @ n) - ahead)
        share = 1.0 - blocked * (1.0 - ACROSS)
        push = max(abs(ahead), _norm(across_in_f) / share)
        self._limit = most = self._next_limit(push, h)
        if push <= most and blocked == 0.0:
            return None
        return min(max(ahead, -most), most) * n + _within(share * most, across_in_f)

    def _follow(self, force_in_f: Array, behind_in_f: Array, h: float) -> None:
        """Force and error without what is quick, and the error's mean."""
        share = h / self._config.quick_s
        self._late_in_f = self._late_in_f + share * (force_in_f - self._late_in_f)
        self._behind_in_f = self._behind_in_f + share * (behind_in_f - self._behind_in_f)
        self._aim_in_f = self._aim_in_f + h / AIMED_S * (behind_in_f - self._aim_in_f)

    def _blocked(self, late_in_f: Array) -> float:
        """From 0, it follows or hardly pushes, to 1: it stays behind, pushing with the limit."""
        c = self._config
        if not isfinite(self._limit):
            return 0.0
        stays = _share(_norm(self._behind_in_f) / c.follows_m - 1.0)
        pushes = float(late_in_f @ _unit(self._aim_in_f)) / self._limit
        return stays * _share((pushes - FREE) / (1.0 - FREE))

    def _along(self, beyond_in_f: Array, blocked: float) -> Array:
        """Unit vector (3,) to cut along: a force itself, or what blocks the robot."""
        own, aim = _unit(beyond_in_f), _unit(self._aim_in_f)
        return own if blocked == 0.0 else _unit((1.0 - blocked) * own + blocked * aim)

    def _brake(self, braking_in_f: Array, h: float) -> Array:
        """Of the body's own quick motion; what lasts is the accelerometer's bias, and a tilt's."""
        slow = braking_in_f if self._slow_in_f is None else self._slow_in_f
        self._slow_in_f = slow + h / SLOW_S * (braking_in_f - slow)
        quick = self._quick_in_f
        rate_in_f = braking_in_f - self._slow_in_f - quick / self._config.quick_s
        self._quick_in_f = quick + h * rate_in_f
        return self._quick_in_f

    def _carry(self, push_in_f: Array, h: float) -> None:
        """Learn what it takes where the robot follows; forget it where it stays behind."""
        c = self._config
        follows = _norm(self._behind_in_f) < c.follows_m
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


def _share(x: float) -> float:
    return min(max(x, 0.0), 1.0)


def _unit(vector: Array) -> Array:
    """Its direction; 0 of 0."""
    length = _norm(vector)
    return vector / length if length > 0.0 else vector


def _within(most: float, vector: Array) -> Array:
    """The same direction, no longer than `most`."""
    length = _norm(vector)
    return vector if length <= most else most / length * vector
