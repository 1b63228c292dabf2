"""Compiled checks that a measurement can be computed with; `sanity` says what they are for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.linear_kernels import cholesky
from pipeline.so3_kernels import kernel

LARGEST = 1e6
"""No place [m], tangent or variance of a measurement has a number beyond it."""
ROTATED = 1e-6
"""How far R Rᵀ may be from the identity ..."""
ALIKE = 1e-9
"""... and a covariance from its transpose, or from a singular one."""


@kernel
def are_modest(values: Array) -> bool:
    """Neither NaN nor so large that computing with them ends in infinity."""
    return bool((np.abs(values) <= LARGEST).all())


@kernel
def is_sound_pose(p: Array, R: Array, C: Array) -> bool:
    """A place (3,), a rotation (3, 3), a symmetric positive definite covariance (6, 6)."""
    if not (are_modest(p) and are_modest(R) and are_modest(C)):
        return False
    off = R @ R.T - np.eye(3)
    if not np.abs(off).max() < ROTATED:
        return False
    if not (
        R[0, 0] * (R[1, 1] * R[2, 2] - R[1, 2] * R[2, 1])
        - R[0, 1] * (R[1, 0] * R[2, 2] - R[1, 2] * R[2, 0])
        + R[0, 2] * (R[1, 0] * R[2, 1] - R[1, 1] * R[2, 0])
        > 0.0
    ):
        return False
    if np.abs(C - C.T).max() > ALIKE * np.abs(C).max():
        return False
    return cholesky(C.copy(), 0.0)


@kernel
def are_sound_rays(
    led: npt.NDArray[np.int64], t: Array, tangents: Array, C: Array, leds: int
) -> bool:
    """LEDs (n,) below `leds`, each once; times (n,), tangents (n, 2), covariances (n, 2, 2)."""
    if not (np.isfinite(t).all() and are_modest(tangents) and are_modest(C)):
        return False
    largest = np.abs(C).max()
    for i in range(len(led)):
        if not 0 <= led[i] < leds or (led[:i] == led[i]).any():
            return False
        c00, c11, c01 = C[i, 0, 0], C[i, 1, 1], C[i, 0, 1]
        if abs(c01 - C[i, 1, 0]) > ALIKE * largest or not c00 > 0.0:
            return False
        if not c00 * c11 - c01 * c01 > ALIKE * c00 * c11:
            return False
    return True
