"""What a pose is worth beside the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hardware.sim.scenes.video import RenderedFrame
from pipeline.camera.lens import Camera
from pipeline.frames import Array, exp, log
from pipeline.signals import RelativePose

WRONG_M, WRONG_SHARE, WRONG_RAD = 0.02, 0.05, np.deg2rad(10.0)
"""Beyond 2 cm + 5 % of the range, or 10°, a reported pose is wrong."""
MEDIAN_CHI2_6 = 5.348
"""Median of χ² with 6 degrees of freedom: NEES/6 is 0.89 in the median if consistent."""
STEP = 1e-5  # of a numeric derivative [m, rad]


@dataclass(frozen=True, slots=True)
class Error:
    """Error of one pose."""

    lateral_m: float
    """Across the line of sight."""
    depth_m: float
    """Along it."""
    turn_rad: float
    nees: float
    """Squared error over the claimed covariance; 6 is expected."""
    pixel2: float
    """Over that of an estimator whose LEDs have unit pixel noise."""
    bound2: float
    """Over the Cramér-Rao bound; NaN if the shot has none."""
    bound_lateral_m: float
    bound_depth_m: float
    bound_turn_rad: float
    """Standard deviations at the bound; NaN as above."""


def error_of(pose: RelativePose, shot: RenderedFrame) -> Array:
    """(6,): δp in c [m] and θ in b [rad], with truth = estimate ⊞ error."""
    turn = log(pose.R_cb.T @ shot.R_cb)
    return np.concatenate((shot.p_bc_in_c - pose.p_bc_in_c, turn))


def is_wrong(pose: RelativePose, shot: RenderedFrame) -> bool:
    """Whether a reported pose is none of this robot."""
    error = error_of(pose, shot)
    far = WRONG_M + WRONG_SHARE * float(np.linalg.norm(shot.p_bc_in_c))
    return bool(np.linalg.norm(error[:3]) > far or np.linalg.norm(error[3:]) > WRONG_RAD)


def measured(pose: RelativePose, shot: RenderedFrame, camera: Camera, leds_in_b: Array) -> Error:
    """All figures of a pose."""
    error = error_of(pose, shot)
    frame_pipeline = shot.p_bc_in_c / np.linalg.norm(shot.p_bc_in_c)
    depth = float(frame_pipeline @ error[:3])
    J = jacobian(shot, camera, leds_in_b)[shot.visible]
    H = np.einsum("nij,nik->jk", J, J)
    known = np.einsum("nij,nil,nlk->jk", J, shot.information[shot.visible], J)
    bound = _inverse(known)
    p, theta = bound[:3, :3], bound[3:, 3:]
    depth_variance = float(frame_pipeline @ p @ frame_pipeline)
    return Error(
        lateral_m=float(np.linalg.norm(error[:3] - depth * frame_pipeline)),
        depth_m=abs(depth),
        turn_rad=float(np.linalg.norm(error[3:])),
        nees=float(error @ np.linalg.solve(pose.covariance, error)),
        pixel2=float(error @ H @ error),
        bound2=float(error @ known @ error) if np.isfinite(depth_variance) else np.nan,
        bound_lateral_m=float(np.sqrt(np.trace(p) - depth_variance)),
        bound_depth_m=float(np.sqrt(depth_variance)),
        bound_turn_rad=float(np.sqrt(np.trace(theta))),
    )


def jacobian(shot: RenderedFrame, camera: Camera, leds_in_b: Array) -> Array:
    """(n, 2, 6): how the LEDs' pixels follow the true pose (δp in c, θ in b)."""
    steps = STEP * np.vstack((np.eye(6), -np.eye(6)))
    points = [shot.p_bc_in_c + s[:3] + leds_in_b @ (shot.R_cb @ exp(s[3:])).T for s in steps]
    pixels = camera.pixels(np.concatenate(points)).reshape(12, -1, 2)
    J: Array = ((pixels[:6] - pixels[6:]) / (2.0 * STEP)).transpose(1, 2, 0)
    return J


def _inverse(information: Array) -> Array:
    """NaN where there is none."""
    if np.linalg.matrix_rank(information) < 6:
        return np.full((6, 6), np.nan)
    inverse: Array = np.linalg.inv(information).astype(np.float64)
    return inverse
