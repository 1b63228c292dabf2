"""Pose error, its rate, and the PID: Eq. (14)-(20), with v in place of c."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.config import Gains
from pipeline.frames import Array, log
from pipeline.signals import VirtualView


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


def pose_error(view: VirtualView, reference: Reference) -> PoseError:
    """Error of the body in view. Eq. (14), (15), (18), (19)."""
    return PoseError(
        e_p_in_v=reference.p_rv_in_v - view.p_bv_in_v,
        e_p_rate_in_v=-view.v_bv_in_v,
        e_eta_in_b=log(view.R_vb.T @ reference.R_vr),
        e_eta_rate_in_b=view.R_vb.T @ view.omega_vf_in_v - view.omega_bf_in_b,
    )


class Pid:
    """PID over the six axes, with what the thrusters could not give taken back from the integral.

    Deviation from Eq. (20): the gains act in b as in the paper, but the force's integral is kept
    in f, because what it must learn (spring, weight) is constant there and not in b or v; and
    there is anti-windup.
    """

    def __init__(self, gains: Gains) -> None:
        """Integrals start at zero: the robot hangs at rest."""
        self._gains = gains
        self._integral_force_in_f = np.zeros(3)
        self._integral_torque_in_b = np.zeros(3)

    def reset(self) -> None:
        """Forget the integrals."""
        self._integral_force_in_f = np.zeros(3)
        self._integral_torque_in_b = np.zeros(3)

    def take_over(self, force_in_f: Array) -> None:
        """Go on from a force (3,) [N] that another controller has held: no jump of thrust."""
        self._integral_force_in_f = force_in_f

    def wrench(self, error: PoseError, view: VirtualView) -> Array:
        """Force and torque on the body, in b (6,) [N, N m]. Eq. (20)."""
        Kp, Kd = self._gains.Kp, self._gains.Kd
        R_bv = view.R_vb.T
        force_in_b = (
            Kp[:3] * (R_bv @ error.e_p_in_v)
            + Kd[:3] * (R_bv @ error.e_p_rate_in_v)
            + (view.R_fv @ view.R_vb).T @ self._integral_force_in_f
        )
        torque_in_b = (
            Kp[3:] * error.e_eta_in_b + Kd[3:] * error.e_eta_rate_in_b + self._integral_torque_in_b
        )
        return np.concatenate((force_in_b, torque_in_b))

    def integrate(
        self, error: PoseError, view: VirtualView, missing_wrench_in_b: Array, h: float
    ) -> None:
        """Carry the integrals on by `h`; `missing_wrench_in_b` (6,) is commanded minus achieved."""
        gains = self._gains
        R_fb = view.R_fv @ view.R_vb
        # back-calculation: the integral gives way at the controller's own speed, K_i / K_p
        back = missing_wrench_in_b * gains.Ki / gains.Kp
        force_rate_in_b = gains.Ki[:3] * (view.R_vb.T @ error.e_p_in_v) - back[:3]
        self._integral_force_in_f = self._integral_force_in_f + h * (R_fb @ force_rate_in_b)
        self._integral_torque_in_b = self._integral_torque_in_b + h * (
            gains.Ki[3:] * error.e_eta_in_b - back[3:]
        )
