"""Virtual camera: at the real one's origin, its attitude low-passed against tremor.

Deviation from Eq. (21): the low pass acts on SO(3), not on roll, pitch and yaw, because those jump
by 360° when the yaw passes ±180° (the reference would jump by metres) and are singular at pitch
±90°.
"""

from __future__ import annotations

from math import exp as exponential

import numpy as np

from pipeline.config import VirtualCameraConfig
from pipeline.frames import Array, cross, exp, log
from pipeline.signals import RelativeState, VirtualView


class VirtualCamera:
    """Two first-order stages on SO(3) behind each other. Eq. (21)."""

    def __init__(self, config: VirtualCameraConfig) -> None:
        """Time constants of the stages."""
        self._config = config
        self._A: Array | None = None
        self._R_fv: Array | None = None

    def reset(self) -> None:
        """Begin again at the real camera's attitude, without a jump: v = c."""
        self._A = self._R_fv = None

    def step(self, R_fc: Array, omega_cf_in_c: Array, h: float) -> tuple[Array, Array]:
        """Follow the camera for `h` seconds; gives R_fv and ^v ω_{v/f}. Eq. (24)."""
        if self._A is None or self._R_fv is None:
            self._A, self._R_fv = R_fc, R_fc
        if self._config.tau_1 <= 0.0:
            self._A, self._R_fv = R_fc, R_fc
            return R_fc, omega_cf_in_c
        self._A = self._A @ exp(_share(h, self._config.tau_1) * log(self._A.T @ R_fc))
        turn = _share(h, self._config.tau_2) * log(self._R_fv.T @ self._A)
        self._R_fv = self._R_fv @ exp(turn)
        return self._R_fv, turn / h

    def view(self, relative: RelativeState, R_fc: Array, h: float) -> VirtualView:
        """One step, and the relative state seen from v. Eq. (22), (23)."""
        R_fv, omega_vf_in_v = self.step(R_fc, relative.omega_cf_in_c, h)
        R_vc = R_fv.T @ R_fc
        p_bv_in_v = R_vc @ relative.p_bc_in_c
        return VirtualView(
            R_fv=R_fv,
            omega_vf_in_v=omega_vf_in_v,
            p_bv_in_v=p_bv_in_v,
            R_vb=R_vc @ relative.R_cb,
            v_bv_in_v=R_vc @ relative.u_bf_in_c - cross(omega_vf_in_v, p_bv_in_v),
            omega_bf_in_b=relative.omega_bf_in_b,
        )


def _share(h: float, tau: float) -> float:
    """Of the way to the target that a first-order low pass goes in `h`."""
    return 1.0 - exponential(-h / tau) if tau > 0.0 else 1.0


def cutoff_hz(config: VirtualCameraConfig) -> float:
    """Frequency at which a turn of the phone reaches the robot with −3 dB."""
    if config.tau_1 <= 0.0:
        return float("inf")
    a, b = config.tau_1**2, config.tau_2**2
    # |H|² = 1/((1+a w²)(1+b w²)) = 1/2, a quadratic in w²
    roots = np.roots([a * b, a + b, -1.0]) if b > 0.0 else np.array([1.0 / a])
    return float(np.sqrt(max(roots.real)) / (2.0 * np.pi))
