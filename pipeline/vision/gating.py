"""Gating of poses: reprojection error and gravity reject nearly all outliers."""

from __future__ import annotations

from math import acos, degrees
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.signals import RelativePose
from pipeline.vision_config import GatesConfig

UNGATED: Final = 1e9
"""χ² of an LED: what a pose or a candidate is held against must rest on all its LEDs."""


def gate_rejection(
    pose: RelativePose, up_in_c: Array | None, up_in_b: Array | None, config: GatesConfig
) -> str | None:
    """Why `pose` is not believed, or None.

    Args:
        pose: Measured in a picture.
        up_in_c: Opposite of gravity in the camera's axes (3,), from the phone; None if unknown.
        up_in_b: The same in the body's axes, from the robot; None if unknown.
        config: Limits.
    """
    finite = np.isfinite(pose.p_bc_in_c).all() and np.isfinite(pose.R_cb).all()
    if not (finite and np.isfinite(pose.covariance).all()):
        return "the pose is not a number"
    distance = float(np.sqrt(pose.p_bc_in_c @ pose.p_bc_in_c))
    if pose.p_bc_in_c[0] <= 0.0:
        return "the pose is behind the camera"
    if not config.min_range_m <= distance <= config.max_range_m:
        return f"{distance:.1f} m away: outside {config.min_range_m} to {config.max_range_m} m"
    if pose.reprojection_px > config.reprojection_px:
        return f"the LEDs fit only to {pose.reprojection_px:.1f} px"
    if up_in_c is not None and up_in_b is not None:
        tilt = angle_between(up_in_c, pose.R_cb @ up_in_b)
        if tilt > config.gravity_rad:
            return f"gravity disagrees by {degrees(tilt):.0f}°: is the picture turned or mirrored?"
    return None


def angle_between(a: Array, b: Array) -> float:
    """Angle between two vectors [rad]."""
    cosine = float(a @ b) / float(np.sqrt((a @ a) * (b @ b)))
    return acos(max(-1.0, min(1.0, cosine)))
