"""Compiled: the pose that fits named spots, for the many hypotheses of a search."""

from __future__ import annotations

from math import acos, cos, sqrt

import numpy as np

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array
from pipeline.identification.association_kernels import BinnedSpots, Integers, place
from pipeline.identification.projection_kernels import put_jacobian, put_moved
from pipeline.linear_kernels import cholesky, solve_by
from pipeline.so3_kernels import kernel

ITERATIONS = 6
CONVERGED = 1e-12
LEAP2 = 4.0
"""A step longer than 2 (m, rad) leads nowhere."""


@kernel
def _linearised(
    p: Array,
    R: Array,
    leds: Array,
    names: Integers,
    without: int,
    lights: BinnedSpots,
    A: Array,
    b: Array,
    J: Array,
) -> float:
    """Normal equations A (6, 6), b (6,); squared residuals (tangents), < 0 behind the camera."""
    total = 0.0
    A[:], b[:] = 0.0, 0.0
    for k in range(leds.shape[0]):
        if names[k] < 0 or k == without:
            continue
        x, left, up = place(p, R, leds, k)
        if x < NEAREST_M:
            return -1.0
        put_jacobian(x, left, up, R, leds[k], 1.0, J)
        for r in range(2):
            residual = lights.tangents[names[k], r] - (left if r == 0 else up)
            total += residual * residual
            for i in range(6):
                b[i] += J[r, i] * residual
                for j in range(i + 1):
                    A[i, j] += J[r, i] * J[r, j]
    return total


@kernel
def fit(
    p: Array, R: Array, leds: Array, names: Integers, without: int, lights: BinnedSpots
) -> float:
    """Gauss-Newton of p and R to the named spots but LED `without`.

    Returns:
        Sum of the squared residuals, in tangents; negative if there is no fit.
    """
    A, b, J = np.empty((6, 6)), np.empty(6), np.empty((2, 6))
    T, U = np.empty((3, 3)), np.empty((3, 3))
    for _ in range(ITERATIONS):
        total = _linearised(p, R, leds, names, without, lights, A, b, J)
        if total < 0.0:
            return -1.0
        for i in range(6):
            A[i, i] *= 1.0 + 1e-9
        if not cholesky(A, 1.0):
            return -1.0
        solve_by(A, b)
        step2 = 0.0
        for i in range(6):
            step2 += b[i] * b[i]
        if not step2 < LEAP2:
            return -1.0
        put_moved(p, R, b, T, p, U)
        R[:] = U
        if step2 < CONVERGED:
            break
    return _linearised(p, R, leds, names, without, lights, A, b, J)


@kernel
def worst(p: Array, R: Array, leds: Array, names: Integers, lights: BinnedSpots) -> float:
    """The largest residual, in tangents."""
    most = 0.0
    for k in range(leds.shape[0]):
        if names[k] >= 0:
            _, y, z = place(p, R, leds, k)
            dy, dz = lights.tangents[names[k], 0] - y, lights.tangents[names[k], 1] - z
            most = max(most, dy * dy + dz * dz)
    return sqrt(most)


@kernel
def angle_to(R: Array, up_in_b: Array, up_in_c: Array) -> float:
    """Angle between R up_in_b and up_in_c, two unit vectors [rad]."""
    cosine = 0.0
    for i in range(3):
        turned = R[i, 0] * up_in_b[0] + R[i, 1] * up_in_b[1] + R[i, 2] * up_in_b[2]
        cosine += turned * up_in_c[i]
    return acos(max(-1.0, min(1.0, cosine)))


@kernel
def is_turned_less(R: Array, Q: Array, most: float) -> bool:
    """Whether a turn of less than `most` [rad] leads from one to the other."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += R[i, j] * Q[i, j]
    less: bool = trace > 1.0 + 2.0 * cos(most)
    return less
