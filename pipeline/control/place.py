"""Where a robot that hangs is, without camera and phone: by what pulls it back.

Pictures tell of the robot relative to the phone, and two motion sensors integrated twice drift by
decimetres in seconds. But what a robot hangs from pulls it back to its rest by K x, and that pull
is known, with that of its damping D: what the accelerometer measures, less what the thrusters give,

    y = x + K⁻¹ D v = K⁻¹ (R_fb F − m (R_fb f_b + g)).

It is right on the mean, and not while thrusters are late; the accelerometer is right at once, and
wrong on the mean. A filter with three equal poles ω takes each where it is right, and a constant
offset b of the acceleration for none of the robot's motion: with d = K⁻¹ D and e = y − x − d v,

    ẋ = v + l₁ e,   v̇ = a − b + l₂ e,   ḃ = −ω³ e,   l₂ = 3ω² − d ω³,   l₁ = 3ω − d l₂.

A force P of somebody else's on the body goes into y, which is (R_fb F + P − m (R_fb f_b + g)) / K.
`PushObserver` tells a quick one from a place: while it learns it, x is carried on by the
accelerometer alone, and what it has learnt is taken off y.

What is left: 1° of tilt in R_fb is 2 cm for a cable of 1.3 m; a push that began slowly is taken for
P / K; thrust that is 10 % less than told makes x 10 % too large.
"""

from __future__ import annotations

import numpy as np

from pipeline.control import low_pass
from pipeline.control.feedforward import G_IN_F
from pipeline.control.push import PushObserver
from pipeline.frames import Array
from pipeline.robot import Robot

REST_S: float = 5.0
"""How fast is learnt what is measured at rest, thrusters off [s]: two swings of the AMES."""
FARTHEST_M = 0.1
"""A rest measured farther away [m] is an attitude's fault: 5° of tilt, or 3° and an accelerometer
that is 40 mg off. A phone that was turned with its gyroscope silent had it at 0.7."""
POLES: float = 3.0
"""ω [1/s]: the pendulum's own is 2.7. Faster, thrusters' lag and damping count for motion; slower,
an error of the vertical, which the accelerometer takes for a / ω²."""
SETTLED_S = 2.5
"""Until what a touch put wrong has been forgotten [s]: seven and a half time constants."""


class SuspendedPlace:
    """Call `propagate` every period, and `start` when its displacement is to be zero."""

    def __init__(self, robot: Robot) -> None:
        """At rest."""
        self._m, self._lag_s = robot.mass, robot.thrust_lag_s + robot.thrust_delay_s
        hangs = bool((robot.stiffness_in_f > 0.0).all())
        self._softness_in_f = 1.0 / robot.stiffness_in_f if hangs else np.zeros(3)
        self._lead_s = self._softness_in_f * robot.damping_in_f
        self._l_2 = 3.0 * POLES**2 - self._lead_s * POLES**3
        self._l_1 = 3.0 * POLES - self._lead_s * self._l_2
        self._thrust_in_f, self._bias_in_f = np.zeros(3), np.zeros(3)
        self._p_in_f, self._p_start_in_f = np.zeros(3), np.zeros(3)
        self._stiffness_in_f, self._push, self._hangs = robot.stiffness_in_f, PushObserver(), hangs
        self._rest_in_f, self._rested_s = np.zeros(3), 0.0
        self.v_in_f: Array = np.zeros(3)
        """Velocity of the body (3,) [m/s]."""

    @property
    def x_in_f(self) -> Array:
        """Displacement of the body since `start` (3,) [m]."""
        x_in_f: Array = self._p_in_f - self._p_start_in_f
        return x_in_f

    @property
    def is_pushed(self) -> bool:
        """Whether something else than thrusters and suspension has just begun or ended to push."""
        return self._push.is_new

    @property
    def is_known(self) -> bool:
        """Whether it hangs, and nothing else has touched it for long enough: x and v are right."""
        return self._hangs and self._push.untouched_s > SETTLED_S

    @property
    def is_steady(self) -> bool:
        """Whether x is right, pushed or not: what may be wrong by a touch has been told apart.

        Enough for who is led; not for who is to stay by it, blind, with an attitude in doubt.
        """
        return self._hangs and self._push.is_told_apart

    @property
    def from_rest_in_f(self) -> Array:
        """Displacement of the body from where it hangs without thrust (3,) [m].

        The accelerometer's bias and the tilt's error at rest are taken off it.
        """
        x_in_f: Array = self._p_in_f - self._rest_in_f
        return x_in_f

    def force_to_stay_in_f(self, offset_in_f: Array) -> Array:
        """What the thrusters must give (3,) [N] for it to stay `offset_in_f` (3,) [m] from here.

        In the units in which they are commanded: an error of K or of all thrusts goes out.
        """
        pulled_in_f = self._stiffness_in_f * (self.from_rest_in_f + offset_in_f)
        force_in_f: Array = pulled_in_f - self._push.known_in_f
        return force_in_f

    def start(self) -> None:
        """From here on its displacement is counted."""
        self._p_start_in_f = self._p_in_f

    def turn(self, turn_of_f: Array) -> None:
        """The axes of f were put right by (3, 3), or begin anew by another phone's."""
        self._thrust_in_f, self._bias_in_f = (
            turn_of_f @ self._thrust_in_f,
            turn_of_f @ self._bias_in_f,
        )
        self._p_in_f, self._p_start_in_f = turn_of_f @ self._p_in_f, turn_of_f @ self._p_start_in_f
        self._rest_in_f, self.v_in_f = turn_of_f @ self._rest_in_f, turn_of_f @ self.v_in_f

    def propagate(
        self, f_bf_in_b: Array, R_fb: Array, force_in_b: Array, h: float, knows_vertical: bool
    ) -> None:
        """Carry place and velocity on.

        Args:
            f_bf_in_b: Specific force (3,) [m/s²].
            R_fb: Attitude of the body.
            force_in_b: Of the thrusters last commanded (3,) [N].
            h: Since the last call [s].
            knows_vertical: Whether the attitude does not drift: by 1° a rest is 2 cm off, and
                stays so for a whole flight.
        """
        given = low_pass.share(h / self._lag_s)
        self._thrust_in_f = self._thrust_in_f + given * (R_fb @ force_in_b - self._thrust_in_f)
        a_in_f = R_fb @ f_bf_in_b + G_IN_F
        pulled_in_f = self._softness_in_f * (self._thrust_in_f - self._m * a_in_f)
        is_near = float(pulled_in_f @ pulled_in_f) < FARTHEST_M**2
        if knows_vertical and is_near and not force_in_b.any():
            self._rested_s += h
            share = max(low_pass.share(h / REST_S), h / self._rested_s)
            self._rest_in_f = self._rest_in_f + share * (pulled_in_f - self._rest_in_f)
        pulled_in_f = pulled_in_f + self._softness_in_f * self._push.force_in_f
        e_in_f = pulled_in_f - self._p_in_f - self._lead_s * self.v_in_f
        missed_in_f = -self._stiffness_in_f * e_in_f
        to_come_n = float(np.linalg.norm(R_fb @ force_in_b - self._thrust_in_f))
        if self._push.observe(missed_in_f, to_come_n, h, is_off=not force_in_b.any()):
            e_in_f = np.zeros(3)
        self._p_in_f = self._p_in_f + h * (self.v_in_f + self._l_1 * e_in_f)
        self.v_in_f = self.v_in_f + h * (a_in_f - self._bias_in_f + self._l_2 * e_in_f)
        self._bias_in_f = self._bias_in_f - h * POLES**3 * e_in_f
