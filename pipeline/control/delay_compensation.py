"""Delay compensation: the error of attitude as it will be when what is decided now begins to act.

Thrusters begin d after a command and follow it with a time constant T. Where that which they are
told already turns the body until then is known, and T later, which takes the lag out of the loop as
far as their limits let it (O. J. M. Smith, Chem. Eng. Progress 53, 1957; Z. Artstein, IEEE TAC 27,
1982):

    e(t + d) = e + d ė + ½ d² ω̇_r − ∬ ω̇,   ė(t + d) = ė + d ω̇_r − ∫ ω̇,   ω̇ = J⁻¹ (τ + τ_d)
    e* = e(t + d) + T ė(t + d),             ė* = ė(t + d) + T (ω̇_r − ω̇(t + d))

τ is what thrusters give by the model; τ_d what else turns the body, as its gyroscope feels it
now: the suspension, the air, and what is wrong with the model. The place goes without: the force
that this adds for an instant is no force to hold in a gap, or to press an obstacle with.
"""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np

from pipeline.control import low_pass
from pipeline.control.pid import PoseError
from pipeline.control.thruster_model import ThrusterModel
from pipeline.frames import Array
from pipeline.robot import Robot

DISTURBANCE_HZ: Final = 30.0
"""How fast τ_d is felt: keeps out the noise of the gyroscope's derivative; a lag here costs phase
where the loop acts, at 2 to 3 Hz."""
STANDS_S: Final = 0.05
"""A rate that has not changed for longer does not change."""


class DelayCompensation:
    """Call `observe` every period, after the thrusters' model."""

    def __init__(self, robot: Robot, thrusters: ThrusterModel) -> None:
        """At rest."""
        self._J, self._thrusters = robot.inertia, thrusters
        self._disturbance_in_b = np.zeros(3)
        self._omega_bf_in_b: Array | None = None
        self._impulse_in_b, self._since_s = np.zeros(3), 0.0
        """What the thrusters have given since, and for how long."""

    def observe(self, omega_bf_in_b: Array, impulse_in_b: Array, h: float) -> None:
        """Follow what else than the thrusters turns the body.

        Args:
            omega_bf_in_b: The body's angular rate (3,) [rad/s].
            impulse_in_b: What the thrusters have given since the last call (3,) [N m s].
            h: The seconds since then.
        """
        before = omega_bf_in_b if self._omega_bf_in_b is None else self._omega_bf_in_b
        self._impulse_in_b = self._impulse_in_b + impulse_in_b
        self._since_s += h
        # where a link brings samples by the handful, the rate stands still between them
        if (before == omega_bf_in_b).all() and self._since_s < STANDS_S:
            self._omega_bf_in_b = before
            return
        felt_in_b = (self._J * (omega_bf_in_b - before) - self._impulse_in_b) / self._since_s
        share = low_pass.share(2.0 * pi * DISTURBANCE_HZ * self._since_s)
        self._disturbance_in_b = self._disturbance_in_b + share * (
            felt_in_b - self._disturbance_in_b
        )
        self._omega_bf_in_b, self._impulse_in_b, self._since_s = omega_bf_in_b, np.zeros(3), 0.0

    def body(self, omega_bf_in_b: Array) -> tuple[Array, Array]:
        """How far the body will have turned (3,) [rad], and its angular rate (3,) [rad/s].

        By its rate now, and led by the thrusters' lag.
        """
        d, T = self._thrusters.delay_s, self._thrusters.lag_s
        given, once, twice = (wrench[3:] for wrench in self._thrusters.ahead())
        omega_in_b = omega_bf_in_b + (once + d * self._disturbance_in_b) / self._J
        turned_in_b = d * omega_bf_in_b + (twice + 0.5 * d * d * self._disturbance_in_b) / self._J
        omega_rate_in_b = (given + self._disturbance_in_b) / self._J
        return turned_in_b + T * omega_in_b, omega_in_b + T * omega_rate_in_b

    def ahead(self, error: PoseError, omega_bf_in_b: Array, omega_rate_in_b: Array) -> PoseError:
        """With (e*, ė*) of the attitude for the one now.

        Args:
            error: As it is.
            omega_bf_in_b: The body's angular rate (3,) [rad/s].
            omega_rate_in_b: Angular acceleration of the reference (3,) [rad/s²].
        """
        d, T = self._thrusters.delay_s, self._thrusters.lag_s
        omega_rf_in_b = error.e_eta_rate_in_b + omega_bf_in_b
        turned_in_b, omega_in_b = self.body(omega_bf_in_b)
        goes_in_b = (d + T) * omega_rf_in_b + d * (0.5 * d + T) * omega_rate_in_b
        return PoseError(
            e_p_in_v=error.e_p_in_v,
            e_p_rate_in_v=error.e_p_rate_in_v,
            e_eta_in_b=error.e_eta_in_b + goes_in_b - turned_in_b,
            e_eta_rate_in_b=omega_rf_in_b + (d + T) * omega_rate_in_b - omega_in_b,
        )
