"""Compliance: against an obstacle the robot pushes no harder than it may, and does not bounce.

PID and feed-forward ask for a force F, which pushes with p = F - q - u beyond what has held the
robot lately, u; more than the limit F_max of it is cut. PID's anti-windup is told what was cut, so
its integral gives way as if the reference had: the robot pushes with F_max however far the
reference lies behind the obstacle, lets go when the reference turns back, and goes there slowly
when the obstacle goes. There are two laws.

Where it follows its reference nothing blocks it, and what it takes to carry it about (a
suspension's pull, its own inertia) is no push: c, as much as F_max again, is let through. Given is

    u + c + q + within(F_max, p - c)

Where it stays behind by more than `follows_m` it is blocked, along n, the mean direction of its
reference, and c is forgotten. Given is

    u + c + q + n within(F_max, n.(L(F) - u - c))
        + within(`across` F_max, (p - c) across n)

so what it takes to follow a hand that wanders along a wall takes no share of the push, and a
socket's sides are pressed less than its bottom. L is a low pass of tau = `quick_s`: a hand's tremor
(8 to 12 Hz; 3.5 kg on a wall of 1e4 N/m ring at 9 Hz) does not reach the wall, where in its troughs
it would take the tool off. From once to twice `follows_m` behind, and from half to all of F_max,
one law's answer is mixed into the other's: beyond u + c + q, 1.06 F_max at most.

q is what the damping D answers to the body's own quick motion, and is never cut: it takes the
energy out of an impact; without it the robot would bounce on a constant force like a ball. It is
the body's own v, as its accelerometer feels it, high-passed with the same tau, so that the low pass
takes no damping away: q = tau s / (tau s + 1) (-D v), and q + L(-D v) = -D v. Only the spring K e
is late by tau, which costs K tau of D: about a third of it. At the limit nothing but a constant
force and q act along n, and q only ever takes energy above 1 / (2 pi sqrt(tau `SLOW_S`)) = 0.7 Hz;
below, where the accelerometer's bias is taken off it, it gives back 0.08 D v at most. The price: a
sudden bias or tilt of 1 m/s² is answered for a tenth of a second, by 2 N at most with D = 30 N s/m.

Only the error tells that it follows: how far the suspension is drawn out can't be had from
accelerometers, since 0.02 m/s² of tilt and bias, integrated twice above 0.1 Hz, are worth more than
its whole pull. So a reference that lies less than `follows_m` behind an obstacle may push with
twice the limit.
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
    """Call `force` every period of tracking."""

    def __init__(self, config: ComplianceConfig) -> None:
        """At rest without a force."""
        self._config = config
        self.start(np.zeros(3))

    def start(self, force_in_f: Array) -> None:
        """Tracking starts from a force that holds the robot (3,) [N]."""
        self._usual_in_f = self._late_in_f = force_in_f
        self._carried_in_f = self._quick_in_f = np.zeros(3)
        self._behind_in_f = self._aim_in_f = np.zeros(3)
        self._slow_in_f: Array | None = None
        self.cut_in_f = np.zeros(3)
        """What was cut of the last force (3,) [N]; that something came late is no cut."""

    def force(self, force_in_f: Array, braking_in_f: Array, behind_in_f: Array, h: float) -> Array:
        """What of a force is to be given (3,) [N].

        Args:
            force_in_f: That PID and feed-forward ask for (3,) [N].
            braking_in_f: Damping times what the body is felt to slow down with (3,) [N/s].
            behind_in_f: From the body to its reference (3,) [m].
            h: Since the last call [s].
        """
        c = self._config
        push_in_f = force_in_f - self._brake(braking_in_f, h) - self._usual_in_f
        self._follow(force_in_f, behind_in_f, h)
        self._carry(push_in_f, h)
        lag_in_f = self._cut(push_in_f - self._carried_in_f)
        if _norm(push_in_f) < FREE * c.limit_n:
            self._usual_in_f = self._usual_in_f + h / c.usual_s * push_in_f
        return force_in_f - lag_in_f - self.cut_in_f

    def _cut(self, beyond_in_f: Array) -> Array:
        """Mix the answers of both laws; gives what of the push comes late (3,) [N]."""
        c = self._config
        aim_in_f = _unit(self._aim_in_f)
        asked = float(beyond_in_f @ aim_in_f)
        late = float((self._late_in_f - self._usual_in_f - self._carried_in_f) @ aim_in_f)
        across_in_f = beyond_in_f - asked * aim_in_f
        follows_in_f = _within(c.limit_n, beyond_in_f)
        blocked_in_f = min(max(late, -c.limit_n), c.limit_n) * aim_in_f
        blocked_in_f = blocked_in_f + _within(c.across * c.limit_n, across_in_f)
        share = self._blocked(late)
        lag_in_f: Array = share * (asked - late) * aim_in_f
        given_in_f = (1.0 - share) * follows_in_f + share * blocked_in_f
        self.cut_in_f = beyond_in_f - lag_in_f - given_in_f
        return lag_in_f

    def _blocked(self, late: float) -> float:
        """From 0, it follows or hardly pushes, to 1: it stays behind, pushing with the limit."""
        c = self._config
        stays = _norm(self._behind_in_f) / c.follows_m - 1.0
        pushes = (late / c.limit_n - FREE) / (1.0 - FREE)
        return _share(stays) * _share(pushes)

    def _follow(self, force_in_f: Array, behind_in_f: Array, h: float) -> None:
        """Force and error without what is quick, and the error's mean."""
        c = self._config
        share = h / c.quick_s
        self._late_in_f = self._late_in_f + share * (force_in_f - self._late_in_f)
        self._behind_in_f = self._behind_in_f + share * (behind_in_f - self._behind_in_f)
        self._aim_in_f = self._aim_in_f + h / c.aimed_s * (behind_in_f - self._aim_in_f)

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


def _norm(vector: Array) -> float:
    return sqrt(float(vector @ vector))


def _share(x: float) -> float:
    return min(max(x, 0.0), 1.0)


def _unit(vector: Array) -> Array:
    """Unit vector; 0 of 0."""
    length = _norm(vector)
    return vector / length if length > 0.0 else vector


def _within(most: float, vector: Array) -> Array:
    """The same direction, no longer than `most`."""
    length = _norm(vector)
    return vector if length <= most else most / length * vector
