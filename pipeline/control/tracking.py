"""Keeping the body at its reference: PID, what is known ahead, softness in contact. Fig. 4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.config import TeleopConfig
from pipeline.control.compliance import Compliance
from pipeline.control.delay_compensation import DelayCompensation
from pipeline.control.feedforward import G_IN_F, FeedForward
from pipeline.control.pid import Pid, PoseError, Reference
from pipeline.control.thruster_model import ThrusterModel
from pipeline.frames import Array
from pipeline.robot import Robot
from pipeline.signals import RelativeState, VirtualView


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """Everything known of robot and phone at this tick."""

    relative: RelativeState
    R_fc: Array
    view: VirtualView


class Tracking:
    """Sibling of `Hold`: what is done while the button is held and all is well."""

    def __init__(self, robot: Robot, config: TeleopConfig) -> None:
        """For one robot."""
        self._axes, self._tilts = robot.axes, robot.needs_tilt
        self._turns = robot.needs_tilt and robot.attitude is None
        self._pid = Pid(config.gains, robot.axes, robot.weight_to_carry)
        self._looks_ahead = config.feedforward.enabled
        self._ahead = FeedForward(robot, config.feedforward)
        self._thrusters = ThrusterModel(robot, 6)
        self._compensation = DelayCompensation(robot, self._thrusters)
        self._compliance = Compliance(config.compliance) if config.compliance.enabled else None
        self._cut_in_b = np.zeros(3)

    @property
    def constant_force_in_f(self) -> Array:
        """(3,) [N]: what it has found to need without any error."""
        learnt_in_f = self._pid.constant_force_in_f
        return learnt_in_f + self._ahead.balanced_in_f if self._looks_ahead else learnt_in_f

    def reset(self) -> None:
        """Forget what was learnt: the robot is at rest without thrust."""
        self._pid.reset()

    def start(self, held_force_in_f: Array | None) -> None:
        """Begin, from rest or from the force (3,) [N] that another controller has held."""
        if held_force_in_f is not None:
            self._pid.take_over(held_force_in_f)
        self._ahead.start()
        if self._compliance is not None:
            self._compliance.start(self._pid.constant_force_in_f)

    def observe(self, now: Situation, told_in_b: Array, h: float) -> None:
        """Every period `h` [s], whatever is done: what else pulls than the thrusters.

        They were `told_in_b` (6,) [N, N m] since the last one.
        """
        relative, R_fb = now.relative, now.view.R_fb
        told = np.concatenate((R_fb @ told_in_b[:3], told_in_b[3:]))
        impulse = self._thrusters.follow(told, h)
        self._ahead.observe(relative.f_bf_in_b, R_fb, self._thrusters.given[:3], h)
        self._compensation.observe(relative.omega_bf_in_b, impulse[3:], h)

    def wrench(
        self,
        now: Situation,
        reference: Reference,
        error: PoseError,
        h: float,
        shares_in_f: Array | None = None,
        brakes_in_f: Array | None = None,
    ) -> Array:
        """Force and torque in b (6,) [N, N m], `h` [s] after the last. Eq. (20).

        `shares_in_f` (3, 3) of the reference's motion are to be gone, None: all of it; beside, it
        is to be accelerated by `brakes_in_f` (3,) [m/s²].
        """
        ahead_in_b = np.zeros(6)
        if self._looks_ahead:
            ahead_in_b = self._ahead.wrench(
                now.relative,
                now.R_fc,
                now.view,
                reference.p_rv_in_v,
                h,
                shares_in_f,
                brakes_in_f,
            )
            if not self._tilts:
                ahead_in_b = ahead_in_b * self._axes
            omega_rate_in_b = now.view.R_vb.T @ self._ahead.omega_rate_v_in_v
            error = self._compensation.ahead(error, now.view.omega_bf_in_b, omega_rate_in_b)
        wrench_in_b = self._pid.wrench(error, now.view) + ahead_in_b
        if self._compliance is not None:
            return self._softened(self._compliance, wrench_in_b, now, error, h)
        return wrench_in_b

    def body_ahead(self, omega_bf_in_b: Array) -> tuple[Array, Array]:
        """How far a body of this rate will have turned (3,) [rad], and its rate (3,) [rad/s] then.

        When that which is decided now acts. Only one that tilts by its own torques goes by it: of
        others it is not worked out.
        """
        if not (self._looks_ahead and self._turns):
            return np.zeros(3), omega_bf_in_b
        return self._compensation.body(omega_bf_in_b)

    def _softened(
        self,
        compliance: Compliance,
        wrench_in_b: Array,
        now: Situation,
        error: PoseError,
        h: float,
    ) -> Array:
        """Yield where the force would be more than an obstacle is to bear."""
        R_fb = now.view.R_fb
        a_bf_in_b = now.relative.f_bf_in_b + R_fb.T @ G_IN_F
        soft_in_f = compliance.force(
            R_fb @ wrench_in_b[:3],
            R_fb @ self._pid.braking_in_b(a_bf_in_b),
            now.view.R_fv @ error.e_p_in_v,
            h,
        )
        self._cut_in_b = R_fb.T @ compliance.cut_in_f
        return np.concatenate((R_fb.T @ soft_in_f, wrench_in_b[3:]))

    def learn(self, error: PoseError, view: VirtualView, missing_in_b: Array, h: float) -> None:
        """Carry the integrals on; `missing_in_b` (6,) of the last wrench could not be given."""
        not_given = _lasting(missing_in_b, self._ahead.inertial_in_b)
        not_given[:3] += self._cut_in_b
        self._pid.integrate(error, view, not_given, h)


def _lasting(missing_in_b: Array, inertial_in_b: Array) -> Array:
    """What would be missing if the body were not to be carried along with the hand (6,).

    A hand that starts asks for its acceleration, and when it stops for the opposite: an integral
    that gave way to what of that can't be had would need a second to learn again what it knew.
    """
    rest_in_b = missing_in_b - inertial_in_b
    size = np.minimum(np.abs(missing_in_b), np.abs(rest_in_b))
    goes_on = missing_in_b * rest_in_b > 0.0
    lasting_in_b: Array = np.where(goes_on, np.copysign(size, missing_in_b), 0.0)
    return lasting_in_b
