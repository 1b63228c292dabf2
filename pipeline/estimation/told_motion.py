"""A robot without motion sensors on its body: its twist in their place, and how far it is believed.

What it says (or, if it measures nothing, what it was told) is its velocity and angular rate. The
specific force that an accelerometer would measure is not made of them: `told_velocity_kernels`
takes the velocity as it is, beside the force that would be felt at rest, which is the vertical. A
robot that stands level knows that by itself; of another one the phone's accelerometer and a picture
tell it at the start, and its own turns carry it on.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp as exponential
from math import hypot, sqrt
from typing import Final

import numpy as np

from pipeline.estimator_config import RelativeConfig
from pipeline.frames import GRAVITY, UP, Array, exp
from pipeline.imu_stream import ImuStream
from pipeline.robot import ToldMotion

SLIP_S: Final = 1.0
"""How long a slip lasts: a wheel on a joint of the floor, a turn on gravel."""
LATE_S: Final = 0.01
"""What another lag than was thought makes of a velocity counts as white noise that lasts so long,
fitted so that NEES stays in its band for a lag as wrong as is said. As a change of velocity, which
it is, u' would take it up, and control, which takes u' for the hand's, would chase its own tail."""
TURNS_S: Final = 0.02
"""The same of its turns, slips included."""
LEFT: Final = 0.3
"""Share of what another lag makes that is left where each measured twist takes off what it finds:
how far a hand's velocity changes from one to the next."""
CHANGES_S: Final = 0.05
"""Over which a change of the twist is looked at: single samples jump as each new twist comes."""
FLOOR: Final = np.array([1e-3, 2e-2, 5e-4])
"""Noise densities of what stands as still as it says: rate, specific force and velocity [rad/s,
m/s², m/s, /√Hz]."""
STEADY: Final = 1e-3
"""Of what is not measured but given [rad/s, m/s²]."""
BY_PHONE: Final = 0.5
"""Of a vertical by a hand's accelerometer over `AVERAGED_S` [m/s²]."""
WANDERS: Final = 5e-3
"""Of that vertical, carried on by twists, beside what the noise of their turns makes [m/s²/√s]."""
AVERAGED_S: Final = 0.1


def for_body(config: RelativeConfig, motion: ToldMotion | None) -> RelativeConfig:
    """The filter's numbers for a robot: without biases of sensors that it does not have."""
    if motion is None:
        return config
    noise = motion.noise_omega * sqrt(motion.interval_s) if motion.is_measured else 0.0
    return replace(
        config,
        sigma_omega_b=STEADY,
        sigma_f_b=STEADY,
        rough_f_b=STEADY,
        drift_f_b=STEADY,
        walk_omega_b=1e-6,
        initial_omega_b=1e-5,
        initial_f_b=GRAVITY * motion.tilt if motion.is_level else BY_PHONE,
        walk_f_b=config.walk_f_b if motion.is_level else hypot(WANDERS, GRAVITY * noise),
        body_steps=False,
    )


class ToldTwist:
    """How far each twist is believed; feed it all, in the order of their times."""

    def __init__(self, motion: ToldMotion) -> None:
        """At rest."""
        self._motion = motion
        self._t, self._before = -np.inf, np.zeros(6)

    def doubts(self, t: float, twist_in_b: Array) -> Array:
        """Square roots (3,) of noise densities at `t` [s]: of angular rate, force and velocity.

        [rad/s/√Hz, m/s²/√Hz, m/s/√Hz], of a twist (6,) [m/s, rad/s]. A velocity that is off for
        longer than pictures need to show it is off as the camera's would be: u' takes it up, and
        by force it may change.
        """
        motion = self._motion
        keep = exponential(-max(0.0, t - self._t) / CHANGES_S)
        late_s = motion.unlike_s * (LEFT if motion.is_measured else 1.0)
        change = late_s * (twist_in_b - self._before) / CHANGES_S
        self._before = twist_in_b + keep * (self._before - twist_in_b)
        self._t = max(t, self._t)
        slips = motion.slip * twist_in_b
        late_v, late_turn, slip_v, slip_turn = (
            float(half @ half) for half in (change[:3], change[3:], slips[:3], slips[3:])
        )
        turn, force, v = np.square(FLOOR).tolist()
        turn += 2.0 * TURNS_S * (slip_turn + late_turn)
        force += 2.0 * slip_v / SLIP_S
        v += 2.0 * LATE_S * late_v
        if motion.is_measured:
            turn += motion.noise_omega**2 * motion.interval_s
            v += motion.noise_v**2 * motion.interval_s
        doubts: Array = np.sqrt(np.array([turn, force, v]))
        return doubts


class ToldVertical:
    """Which way is up in the body's axes."""

    def __init__(self, motion: ToldMotion) -> None:
        """Known of one that stands level alone."""
        self._is_level = self.is_known = motion.is_level
        self._up, self._t = UP, -np.inf

    def force(self, t: float, omega: Array) -> Array:
        """What would be felt at rest (3,) [m/s²], turning by `omega` (3,); zeros: not known."""
        if not self.is_known:
            return np.zeros(3)
        if not self._is_level and t > self._t:
            self._up, self._t = exp(-(t - self._t) * omega) @ self._up, t
        return GRAVITY * self._up

    def learn(self, t: float, R_cb: Array, phone: ImuStream, body: ImuStream) -> None:
        """By a pose (3, 3) of `t` [s]; samples of the body that had no force get theirs."""
        near = np.abs(phone.times - t) < AVERAGED_S
        if self.is_known or not near.any() or not body.oldest < np.inf:
            return
        felt = R_cb.T @ phone.values[near, 3:6].mean(axis=0)
        up, t = felt / float(np.sqrt(felt @ felt)), min(max(t, body.oldest), body.newest)
        times = body.times
        for k in range(int(np.searchsorted(times, body.oldest)), len(times)):
            body.values[k, 3:6] = GRAVITY * body.turn(float(times[k]), t) @ up
        self._up, self._t, self.is_known = body.turn(body.newest, t) @ up, body.newest, True
