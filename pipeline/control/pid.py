"""Pose error, its rate, and the PID: Eq. (14)-(20), with v in place of c."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array, log
from pipeline.gains import Gains
from pipeline.signals import VirtualView

Axes = npt.NDArray[np.bool_]
ALL_AXES: Final = np.ones(6, dtype=np.bool_)
ALL_AXES.setflags(write=False)
BACK_S: Final = 0.1
"""How fast the integral gives way to the thrusters' limits: a step of 0.6 m against 7 N overshoots
by 3 %; with the usual K_p / K_i, 0.9 s, by 26 %, as much as a small step does."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Where the body should be, constant in v. Taken when tracking starts."""

    p_rv_in_v: Array
    R_vr: Array

    @classmethod
    def here(cls, view: VirtualView) -> Reference:
        """The present pose: starting is bumpless."""
        return cls(view.p_bv_in_v, view.R_vb)


@dataclass(frozen=True, slots=True, eq=False)
class PoseError:
    """What is missing to the reference. Eq. (14), (15)."""

    e_p_in_v: Array
    e_p_rate_in_v: Array
    """Derivative seen from v. Eq. (19)."""
    e_eta_in_b: Array
    """Rotation vector from b to r.

    Deviation from Eq. (15), (16): not roll, pitch and yaw; equal for small errors and never
    singular.
    """
    e_eta_rate_in_b: Array
    """Eq. (18): the reference turns with v, the body turns by itself."""


def pose_error(view: VirtualView, reference: Reference, axes: Axes = ALL_AXES) -> PoseError:
    """Error of the body in view. Eq. (14), (15), (18), (19).

    Along and about the axes of b that are not among `axes` (6,) it counts as none.
    """
    e_p_in_v, e_p_rate_in_v = reference.p_rv_in_v - view.p_bv_in_v, -view.v_bv_in_v
    if not axes[:3].all():
        kept_in_v = (view.R_vb * axes[:3]) @ view.R_vb.T
        e_p_in_v, e_p_rate_in_v = kept_in_v @ e_p_in_v, kept_in_v @ e_p_rate_in_v
    return PoseError(
        e_p_in_v=e_p_in_v,
        e_p_rate_in_v=e_p_rate_in_v,
        e_eta_in_b=axes[3:] * log(view.R_vb.T @ reference.R_vr),
        e_eta_rate_in_b=axes[3:] * (view.R_vb.T @ view.omega_vf_in_v - view.omega_bf_in_b),
    )


class Pid:
    """PID over the six axes, with what the thrusters could not give taken back from the integral.

    Deviation from Eq. (20): the gains act in b as in the paper, but the force's integral is kept
    in f, because what it must learn (spring, weight) is constant there and not in b or v; and
    there is anti-windup.
    """

    def __init__(self, gains: Gains, axes: Axes = ALL_AXES, weight: float = 0.0) -> None:
        """Integrals start at zero: the robot hangs or stands at rest.

        Args:
            gains: Over (x, y, z, roll, pitch, yaw).
            axes: (6,) which of them are controlled; the others ask for nothing, learn nothing.
            weight: What the thrusters must carry from the first moment [N].
        """
        self._axes = axes
        self._Kp, self._Ki, self._Kd = axes * gains.Kp, axes * gains.Ki, axes * gains.Kd
        self._back = (self._Ki > 0.0) / BACK_S
        self._weight_in_f = np.array([0.0, 0.0, weight])
        self.reset()

    def reset(self) -> None:
        """Forget the integrals."""
        self._integral_force_in_f = np.zeros(3)
        self._integral_torque_in_b = np.zeros(3)

    @property
    def constant_force_in_f(self) -> Array:
        """(3,) [N]: what it asks for without any error, by weight and integral."""
        force_in_f: Array = self._integral_force_in_f + self._weight_in_f
        return force_in_f

    def take_over(self, force_in_f: Array) -> None:
        """Go on from a force (3,) [N] that another controller has held: no jump of thrust."""
        self._integral_force_in_f = force_in_f - self._weight_in_f

    def wrench(self, error: PoseError, view: VirtualView) -> Array:
        """Force and torque on the body, in b (6,) [N, N m]. Eq. (20)."""
        Kp, Kd = self._Kp, self._Kd
        force_in_b = (
            Kp[:3] * (view.R_vb.T @ error.e_p_in_v)
            + Kd[:3] * (view.R_vb.T @ error.e_p_rate_in_v)
            + self._axes[:3] * (view.R_fb.T @ self.constant_force_in_f)
        )
        torque_in_b = (
            Kp[3:] * error.e_eta_in_b + Kd[3:] * error.e_eta_rate_in_b + self._integral_torque_in_b
        )
        return np.concatenate((force_in_b, torque_in_b))

    def braking_in_b(self, a_bf_in_b: Array) -> Array:
        """How fast the damping answers to the body's own acceleration (3,) [m/s²]: (3,) [N/s]."""
        braking_in_b: Array = -self._Kd[:3] * a_bf_in_b
        return braking_in_b

    def integrate(
        self, error: PoseError, view: VirtualView, missing_wrench_in_b: Array, h: float
    ) -> None:
        """Carry the integrals on by `h`; `missing_wrench_in_b` (6,) is commanded minus achieved."""
        back = self._back * missing_wrench_in_b
        force_rate_in_b = self._Ki[:3] * (view.R_vb.T @ error.e_p_in_v) - back[:3]
        self._integral_force_in_f = self._integral_force_in_f + h * (view.R_fb @ force_rate_in_b)
        self._integral_torque_in_b = self._integral_torque_in_b + h * (
            self._Ki[3:] * error.e_eta_in_b - back[3:]
        )
