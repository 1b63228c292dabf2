"""A pose as poses.csv tells it: the body in the optical frame o (z forward, x right, y down)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array, R_co, wxyz_from_R
from pipeline.signals import RelativePose
from pipeline.vision.vision import STAGES

POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
SIGMAS = (
    *("sigma_x_m", "sigma_y_m", "sigma_z_m"),
    *("sigma_rx_rad", "sigma_ry_rad", "sigma_rz_rad"),
)
COLUMNS = (
    *("frame", "t_s", "found"),
    *POSE,
    *SIGMAS,
    *("leds", "reprojection_px"),
    *(f"{stage}_us" for stage in STAGES),
)


@dataclass(frozen=True, slots=True, eq=False)
class OpticalPose:
    """The body in o, at the middle row's time."""

    p_bo_in_o: Array
    """(3,) [m]."""
    R_ob: Array
    """(3, 3)."""
    covariance: Array
    """(6, 6) of (δp [m], θ [rad]), both in o, with R_ob = Exp(θ) R̂_ob."""

    @property
    def sigmas(self) -> Array:
        """(6,) standard deviations [m], [rad]."""
        sigmas: Array = np.sqrt(np.diag(self.covariance))
        return sigmas


def optical(pose: RelativePose) -> OpticalPose:
    """Pose in optical axes; its rotation error, in b and to the right of R_cb, turned into o."""
    R_oc = R_co.T
    R_ob = R_oc @ pose.R_cb
    turn = np.zeros((6, 6))
    turn[:3, :3], turn[3:, 3:] = R_oc, R_ob  # R̂ Exp(θ_b) = Exp(R̂ θ_b) R̂
    covariance = turn @ pose.covariance @ turn.T
    return OpticalPose(R_oc @ pose.p_bc_in_c, R_ob, 0.5 * (covariance + covariance.T))


def row(
    name: str, t: float, pose: RelativePose | None, leds: int | None, took_s: Mapping[str, float]
) -> dict[str, str]:
    """Cells of one frame; empty ones where nothing is known."""
    cells = dict.fromkeys(COLUMNS, "")
    cells |= {"frame": name, "t_s": f"{t:.9f}", "found": str(int(pose is not None))}
    if leds is not None:
        cells["leds"] = str(leds)
    for stage in STAGES if took_s else ():
        cells[f"{stage}_us"] = f"{1e6 * took_s.get(stage, 0.0):.1f}"
    if pose is not None:
        seen = optical(pose)
        values = (*seen.p_bo_in_o.tolist(), *wxyz_from_R(seen.R_ob))
        cells |= {key: f"{v:.8f}" for key, v in zip(POSE, values, strict=True)}
        sigmas = seen.sigmas.tolist()
        cells |= {key: f"{v:.4e}" for key, v in zip(SIGMAS, sigmas, strict=True)}
        cells["reprojection_px"] = f"{pose.reprojection_px:.4f}"
    return cells
