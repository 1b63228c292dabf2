"""Virtual camera: at the real one's origin, its attitude low-passed against tremor.

Deviation from Eq. (21): the low pass acts on SO(3), not on roll, pitch and yaw, because those jump
by 360° when the yaw passes ±180° (the reference would jump by metres) and are singular at pitch
±90°.

Beyond the paper: turns about the line of sight may pass (its future work), the cut-off may rise
with the speed of a turn and near the border of the picture, and the reference has a speed limit.
"""

from __future__ import annotations

from math import inf, log

import numpy as np

from pipeline.config import VirtualCameraConfig
from pipeline.control import virtual_camera_kernels as kernels
from pipeline.control.cutoff import cutoff_hz
from pipeline.frames import Array, R_from_wxyz
from pipeline.signals import RelativeState, VirtualView

NO_LIMIT_M_S = 1e4
NO_GUARD = (inf, inf)
NOWHERE = np.zeros(3)
NOWHERE.setflags(write=False)


class VirtualCamera:
    """Two first-order stages on SO(3) behind each other. Eq. (21)."""

    def __init__(self, config: VirtualCameraConfig) -> None:
        """Begins at the camera's first attitude."""
        self._state = np.zeros(kernels.STATE)
        self._x = np.zeros((9, 3))
        self.tune(config)
        # compiles or loads the kernels here: never inside the loop
        self.turn(self.follow(np.eye(3), NOWHERE, 1.0))
        self.reset()

    @property
    def guarding(self) -> float:
        """0: the cut-off is the one set; 1: the robot is at the border, v hurries after c."""
        return float(self._state[kernels.GUARD])

    def tune(self, config: VirtualCameraConfig) -> None:
        """Set runtime parameters in flight; they get there slowly, so that nothing jumps."""
        self._config, self._knobs = config, _knobs(config)

    def reset(self) -> None:
        """Begin again at the real camera's attitude, without a jump: v = c."""
        self._state[:] = 0.0

    def turn(self, turn_of_f: Array) -> None:
        """The axes of f were put right by (3, 3), and R_fc with them: v goes along with c.

        Followed as a motion of c, a vertical that is 0.02 rad/s on its way would have the robot fly
        5 cm/s at 2.5 m.
        """
        kernels.turn_f(self._state, turn_of_f)

    def view(
        self,
        relative: RelativeState,
        R_fc: Array,
        h: float,
        p_ref_in_v: Array | None = None,
        half_field: tuple[float, float] | None = None,
    ) -> VirtualView:
        """One step, and the relative state seen from v. Eq. (21)-(24).

        Args:
            relative: The robot seen from the camera.
            R_fc: Attitude of the camera.
            h: Since the last step [s].
            p_ref_in_v: Where the robot should be, constant in v [m]. None: no reference yet; the
                line of sight is the robot's, and there is nothing to guard.
            half_field: Tangents of half the field of view, to the side and up; None: no guard.
        """
        x = self._x
        x[1], x[6:9] = relative.u_bf_in_c, relative.R_cb
        out = self._step(R_fc, relative.p_bc_in_c, h, p_ref_in_v, half_field)
        return VirtualView(
            R_fv=out[3:6],
            omega_vf_in_v=out[0],
            p_bv_in_v=out[1],
            R_vb=out[6:9],
            v_bv_in_v=out[2],
            omega_bf_in_b=relative.omega_bf_in_b,
            guarding=self.guarding,
        )

    def still(self, relative: RelativeState, R_fc: Array) -> VirtualView:
        """What it sees while it does not follow c: no step, no motion; call `view` before.

        Its origin stays c's.
        """
        R_fv = R_from_wxyz(tuple(self._state[4:8].tolist()))
        R_vc = R_fv.T @ R_fc
        return VirtualView(
            R_fv=R_fv,
            omega_vf_in_v=NOWHERE,
            p_bv_in_v=R_vc @ relative.p_bc_in_c,
            R_vb=R_vc @ relative.R_cb,
            v_bv_in_v=R_vc @ relative.u_bf_in_c,
            omega_bf_in_b=relative.omega_bf_in_b,
        )

    def follow(
        self,
        R_fc: Array,
        p_bc_in_c: Array,
        h: float,
        p_ref_in_v: Array | None = None,
        half_field: tuple[float, float] | None = None,
    ) -> Array:
        """The step alone, for whoever knows only where the robot is; gives R_fv. Eq. (21)."""
        return self._step(R_fc, p_bc_in_c, h, p_ref_in_v, half_field)[3:6]

    def _step(
        self,
        R_fc: Array,
        p_bc_in_c: Array,
        h: float,
        p_ref_in_v: Array | None,
        half_field: tuple[float, float] | None,
    ) -> Array:
        x = self._x  # the kernel is compiled for this, whatever the layout of others' arrays
        x[0], x[3:6] = p_bc_in_c, R_fc
        x[2] = NOWHERE if p_ref_in_v is None else p_ref_in_v
        side, up = half_field if half_field is not None and self._config.guard else NO_GUARD
        out = np.empty((9, 3))
        kernels.view(self._state, self._knobs, x, (float(side), float(up)), h, out)
        return out


def _knobs(config: VirtualCameraConfig) -> Array:
    """(`KNOBS`,) as the kernel wants them."""
    across = along = (_rate(config.tau_1), _rate(config.tau_2))
    if config.mode == "off":
        across = along = (kernels.AT_ONCE, kernels.AT_ONCE)
    elif config.mode == "selective":
        along = (_rate(config.tau_parallel), kernels.AT_ONCE)
    boost = config.adaptive_beta / (max(config.tau_1, 1e-3) * cutoff_hz(config))
    limit = config.max_speed_m_s if config.max_speed_m_s > 0.0 else inf
    log_limit = log(min(limit, NO_LIMIT_M_S))
    return np.array([*across, *along, boost, log_limit, config.guard_start])


def _rate(tau: float) -> float:
    """Logarithm of a stage's rate."""
    return min(-log(tau), kernels.AT_ONCE) if tau > 0.0 else kernels.AT_ONCE
