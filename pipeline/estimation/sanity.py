"""Checks that a measurement can be computed with, made before every estimator."""

from __future__ import annotations

from math import isfinite

import numpy as np

from pipeline.frames import Array
from pipeline.signals import LedRays, RelativePose, VisionMeasurement

LARGEST = 1e6
"""No place [m], tangent or variance of a measurement has a number beyond it."""
MAX_RATE, MAX_FORCE = 100.0, 1000.0
"""Beyond the range of any IMU [rad/s], [m/s²]."""


def are_finite(*values: Array | float) -> bool:
    """No NaN and no infinity in any of them."""
    return all(bool(np.isfinite(value).all()) for value in values)


def are_modest(*values: Array) -> bool:
    """Neither NaN nor so large that computing with them ends in infinity."""
    return all(bool((np.abs(value) <= LARGEST).all()) for value in values)


def is_imu_sample(t: float, rate: Array, force: Array) -> bool:
    """Whether an IMU can have said that: (3,) [rad/s] and (3,) [m/s²] at time `t` [s]."""
    if rate.shape != (3,) or force.shape != (3,) or not isfinite(t):
        return False
    return _is_within(MAX_RATE, rate) and _is_within(MAX_FORCE, force)


def _is_within(most: float, values: Array) -> bool:
    """Whether each of (3,) is a number up to `most`, either way; of so few Python is the faster."""
    return all(abs(value) <= most for value in values.tolist())


def is_pose(pose: RelativePose) -> bool:
    """Finite, a rotation, a symmetric positive definite covariance."""
    p, R, C = pose.p_bc_in_c, pose.R_cb, pose.covariance
    if (p.shape, R.shape, C.shape) != ((3,), (3, 3), (6, 6)) or not are_finite(pose.t):
        return False
    if not are_modest(p, R, C):
        return False
    is_rotation = np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0.0
    is_symmetric = np.abs(C - C.T).max() <= 1e-9 * np.abs(C).max()
    return bool(is_rotation and is_symmetric and np.linalg.eigvalsh(C)[0] > 0.0)


def is_believable(seen: VisionMeasurement, leds: int) -> bool:
    """Whether all of `seen` can be computed with, for a robot with so many `leds`."""
    return (
        bool(np.isfinite(seen.t))
        and is_rays(seen.rays, leds)
        and (seen.pose is None or is_pose(seen.pose))
    )


def is_rays(rays: LedRays, leds: int) -> bool:
    """Known LEDs, each once, finite, with positive definite covariances."""
    m, C = rays.led.size, rays.covariances
    shapes = (rays.led.shape, rays.t.shape, rays.tangents.shape, C.shape)
    if shapes != ((m,), (m,), (m, 2), (m, 2, 2)) or rays.led.dtype.kind not in "iu":
        return False
    if m == 0:
        return True
    if not (are_finite(rays.t) and are_modest(rays.tangents, C)):
        return False
    known = rays.led.min() >= 0 and rays.led.max() < leds and len(set(rays.led.tolist())) == m
    c00, c11, c01 = C[:, 0, 0], C[:, 1, 1], C[:, 0, 1]
    symmetric = np.abs(c01 - C[:, 1, 0]).max() <= 1e-9 * np.abs(C).max()
    definite = (c00 > 0.0) & (c00 * c11 - c01 * c01 > 1e-9 * c00 * c11)
    return bool(known and symmetric and definite.all())
