"""Feed-forward: the wrench that carries the robot along with the hand, before an error shows.

The reference is rigid in v, so the phone's accelerometer and gyroscope tell how it accelerates:

    a_r = a_c + R_fv (ω̇_v × p + ω_v × (ω_v × p)),   a_c = R_fc f_c + g        (p = p_rv in v)
    F = m a_r − F_pull,   τ = J ω̇_v

F_pull is what else pulls at the body (suspension, air, a push) and has changed since the start:
what its accelerometer measures, less what its thrusters give. Without it a suspended robot is
better off without feed-forward: below the pendulum's frequency (the AMES's is 0.43 Hz, a hand's
0.3 Hz) the cable wants more force than the mass, and with the opposite sign.

a_r is band-passed: at the low end go the accelerometer's bias and the error of the vertical, at the
high end its rounding and the hand's tremor. F_pull is low-passed.
"""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np

from pipeline.config import FeedForwardConfig
from pipeline.control import low_pass
from pipeline.frames import GRAVITY, Array, cross
from pipeline.robot import Robot
from pipeline.signals import RelativeState, VirtualView

LASTING_S: Final = 1.0
"""Time constant of what of the pull is no gust."""
G_IN_F = np.array([0.0, 0.0, -GRAVITY])
G_IN_F.setflags(write=False)


class FeedForward:
    """Call `observe` every period, `start` when tracking starts, `wrench` while it lasts."""

    def __init__(self, robot: Robot, config: FeedForwardConfig) -> None:
        """At rest, thrusters off."""
        self._m, self._J, self._config = robot.mass, robot.inertia, config
        self._weight_in_f = np.array([0.0, 0.0, -robot.weight_to_carry])
        self._pull_in_f = np.zeros(3)
        self.start()

    def start(self) -> None:
        """What pulls now is left to the integral; what the hand did before is forgotten.

        Of a robot that carries itself, its weight does; the floor it may still stand on does not.
        """
        if self._weight_in_f.any():
            self._pull_in_f = self._weight_in_f
        self._pull_at_start_in_f = self._pull_in_f
        self._lasting_in_f = np.zeros(3)
        self.inertial_in_b = np.zeros(6)
        """What of the last wrench carries the body along with the hand (6,) [N, N m]."""
        self._omega_v: Array | None = None
        self.omega_rate_v_in_v = np.zeros(3)
        """Angular acceleration of the reference, at the last wrench (3,) [rad/s²]."""
        self._a_slow_in_f: Array | None = None
        self._a_in_f = np.zeros(3), np.zeros(3)

    def observe(self, f_bf_in_b: Array, R_fb: Array, thrust_in_f: Array, h: float) -> None:
        """Follow what pulls at the body.

        Args:
            f_bf_in_b: Specific force (3,) [m/s²].
            R_fb: Attitude of the body.
            thrust_in_f: What the thrusters give now (3,) [N].
            h: Since the last call [s].
        """
        measured = self._m * (R_fb @ f_bf_in_b + G_IN_F) - thrust_in_f
        share = low_pass.share(2.0 * pi * self._config.pull_hz * h)
        self._pull_in_f = self._pull_in_f + share * (measured - self._pull_in_f)
        changed_in_f = self._pull_in_f - self._pull_at_start_in_f
        slow = low_pass.share(h / LASTING_S)
        self._lasting_in_f = self._lasting_in_f + slow * (changed_in_f - self._lasting_in_f)

    @property
    def balanced_in_f(self) -> Array:
        """(3,) [N]: what it has found to be lasting of the pull of a robot that carries itself.

        Its thrusters may give less or more than they are told, and so must be told more or less for
        the same weight. Of what hangs the place says what the suspension pulls.
        """
        return -self._lasting_in_f if self._weight_in_f.any() else np.zeros(3)

    def wrench(
        self,
        relative: RelativeState,
        R_fc: Array,
        view: VirtualView,
        p_rv_in_v: Array,
        h: float,
        shares_in_f: Array | None = None,
        brakes_in_f: Array | None = None,
    ) -> Array:
        """Force and torque in b (6,) [N, N m] after another `h` [s].

        Args:
            relative: For the phone's specific force.
            R_fc: Attitude of the camera.
            view: The robot from v.
            p_rv_in_v: Where the robot should be, constant in v [m].
            h: Since the last call [s].
            shares_in_f: (3, 3), of its acceleration, if the robot is to go only these.
            brakes_in_f: (3,) [m/s²], by which it is to be accelerated beside.
        """
        quick = low_pass.share(2.0 * pi * self._config.low_pass_hz * h)
        turning_in_v = self._turning(view.omega_vf_in_v, p_rv_in_v, quick, h)
        a_in_f = R_fc @ relative.f_cf_in_c + G_IN_F + view.R_fv @ turning_in_v
        slow = a_in_f if self._a_slow_in_f is None else self._a_slow_in_f
        slow = slow + low_pass.share(2.0 * pi * self._config.high_pass_hz * h) * (a_in_f - slow)
        self._a_slow_in_f = slow
        once, twice = self._a_in_f
        once = once + quick * (a_in_f - slow - once)
        self._a_in_f = once, twice + quick * (once - twice)
        a_r_in_f = self._a_in_f[1] if shares_in_f is None else shares_in_f @ self._a_in_f[1]
        if brakes_in_f is not None:
            a_r_in_f = a_r_in_f + brakes_in_f
        R_bf = view.R_vb.T @ view.R_fv.T
        torque_in_b = self._J * (view.R_vb.T @ self.omega_rate_v_in_v)
        self.inertial_in_b = np.concatenate((R_bf @ (self._m * a_r_in_f), torque_in_b))
        wrench_in_b = self.inertial_in_b.copy()
        wrench_in_b[:3] -= R_bf @ (self._pull_in_f - self._pull_at_start_in_f)
        return wrench_in_b

    def _turning(self, omega: Array, p: Array, quick: float, h: float) -> Array:
        """Acceleration of the reference by the turns of v, in v."""
        before = omega if self._omega_v is None else self._omega_v
        self._omega_v = omega
        rate = self.omega_rate_v_in_v
        self.omega_rate_v_in_v = rate + quick * ((omega - before) / h - rate)
        return cross(self.omega_rate_v_in_v, p) + cross(omega, cross(omega, p))
