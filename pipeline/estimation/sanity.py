"""Checks that a measurement can be computed with, made before every estimator."""

from __future__ import annotations

from math import isfinite

import numpy as np

from pipeline.estimation.sanity_kernels import are_sound_rays, is_sound_pose
from pipeline.frames import Array
from pipeline.signals import LedRays, RelativePose, VisionMeasurement

MAX_RATE, MAX_FORCE = 100.0, 1000.0
"""Beyond the range of any IMU [rad/s], [m/s²]."""


def are_finite(*values: Array | float) -> bool:
    """No NaN and no infinity in any of them."""
    return all(bool(np.isfinite(value).all()) for value in values)


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
    if (p.shape, R.shape, C.shape) != ((3,), (3, 3), (6, 6)) or not isfinite(pose.t):
        return False
    return bool(is_sound_pose(_compilable(p), _compilable(R), _compilable(C)))


def _compilable(values: Array) -> Array:
    """As kernels are compiled for: a measurement may lie in any order, or in foreign memory."""
    return np.array(values, dtype=np.float64, order="C")


def is_believable(seen: VisionMeasurement, leds: int) -> bool:
    """Whether all of `seen` can be computed with, for a robot with so many `leds`."""
    return (
        isfinite(seen.t) and is_rays(seen.rays, leds) and (seen.pose is None or is_pose(seen.pose))
    )


def is_rays(rays: LedRays, leds: int) -> bool:
    """Known LEDs, each once, finite, with positive definite covariances."""
    m, C = rays.led.size, rays.covariances
    shapes = (rays.led.shape, rays.t.shape, rays.tangents.shape, C.shape)
    if shapes != ((m,), (m,), (m, 2), (m, 2, 2)) or rays.led.dtype.kind not in "iu":
        return False
    if m == 0:
        return True
    led = np.array(rays.led, dtype=np.int64)
    t, tangents = _compilable(rays.t), _compilable(rays.tangents)
    return bool(are_sound_rays(led, t, tangents, _compilable(C), leds))
