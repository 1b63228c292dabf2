"""What a recording's pictures said, offline: a CSV with one row per picture.

| column | what |
|---|---|
| t_s | arrival of the picture, since the recording's first item |
| capture_s | its capture time, likewise |
| sequence | its number, as the phone counted |
| found, leds, reprojection_px | was the robot found, on how many LEDs, RMS residual |
| x_m, y_m, z_m, qw, qx, qy, qz, sigma_m | pose of the body in camera axes, measured in it |
| fused_x_m … fused_qz, fused_sigma_m | the filter's estimate at the next control period |
| mode | of the failsafe machine, with the recorded button and requests |
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array, wxyz_from_R
from pipeline.signals import RelativePose
from pipeline.teleop import Output
from server.phone.ingest import EncodedFrame

POSE: Final = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "sigma_m")
COLUMNS: Final = (
    *("t_s", "capture_s", "sequence", "found", "leds", "reprojection_px"),
    *POSE,
    *(f"fused_{name}" for name in POSE),
    "mode",
)


def row_of(
    frame: EncodedFrame, pose: RelativePose | None, output: Output, t_first: float
) -> dict[str, str]:
    """Row of an image and what control said next; times since `t_first` [s]."""
    row = dict.fromkeys(COLUMNS, "")
    row["t_s"], row["capture_s"] = f"{frame.t_received - t_first:.6f}", f"{frame.t - t_first:.6f}"
    row["sequence"], row["found"] = str(frame.sequence), str(int(pose is not None))
    row["mode"] = output.failsafe.mode.name
    if pose is not None:
        row["leds"], row["reprojection_px"] = str(pose.leds), f"{pose.reprojection_px:.3f}"
        sigma = float(np.sqrt(np.diag(pose.covariance)[:3].max()))
        row |= _pose_cells("", pose.p_bc_in_c, pose.R_cb, sigma)
    relative = output.relative
    if relative is not None:
        row |= _pose_cells("fused_", relative.p_bc_in_c, relative.R_cb, relative.sigma_p)
    return row


def _pose_cells(prefix: str, p: Array, R: Array, sigma: float) -> dict[str, str]:
    values = (*p.tolist(), *wxyz_from_R(R), sigma)
    return {f"{prefix}{name}": f"{v:.6f}" for name, v in zip(POSE, values, strict=True)}
