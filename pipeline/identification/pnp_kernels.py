"""Compiled: the pose that named LEDs are most likely seen from, by Gauss-Newton."""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.camera.lens_kernels import CUBE, NEAREST_M, OUT_1, OUT_2, TABLE
from pipeline.frames import Array
from pipeline.identification.projection_kernels import put_jacobian, put_moved
from pipeline.jit import numba
from pipeline.linear_kernels import cholesky, solve_by
from pipeline.so3_kernels import kernel

ITERATIONS = 10
CONVERGED = 1e-10
LONGEST_STEP = 1.0
"""Metres or radians; longer, and half as long is tried."""


@kernel
def put_residual(
    led: Array, flat: Array, shift: Array, f: float, p: Array, R: Array, r: Array, J: Array
) -> bool:
    """Residual r (2,) [px] of an LED and its Jacobian J (2, 6) by (δp in c, θ in b).

    The LED is expected at p + shift + R led, and seen at `flat` (right, down) one metre ahead.
    False: it is not in front.
    """
    a0 = R[0, 0] * led[0] + R[0, 1] * led[1] + R[0, 2] * led[2]
    a1 = R[1, 0] * led[0] + R[1, 1] * led[1] + R[1, 2] * led[2]
    a2 = R[2, 0] * led[0] + R[2, 1] * led[1] + R[2, 2] * led[2]
    x, y, z = p[0] + shift[0] + a0, p[1] + shift[1] + a1, p[2] + shift[2] + a2
    if not x > NEAREST_M:
        return False
    y, z = y / x, z / x
    r[0], r[1] = f * (flat[0] + y), f * (flat[1] + z)
    put_jacobian(x, y, z, R, led, -f, J)
    return True


@kernel
def _gather(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    f: float,
    p: Array,
    R: Array,
    information: Array,
    slope: Array,
    residuals: Array,
) -> float:
    """Normal equations and residuals (m, 2); gives χ², NaN if an LED is not in front."""
    information[:], slope[:] = 0.0, 0.0
    J, chi2 = np.empty((2, 6)), 0.0
    for i in range(len(leds)):
        r = residuals[i]
        if not put_residual(leds[i], flat[i], shifts[i], f, p, R, r, J):
            return np.nan
        w00, w01, w11 = weights[i, 0, 0], weights[i, 0, 1], weights[i, 1, 1]
        g0, g1 = w00 * r[0] + w01 * r[1], w01 * r[0] + w11 * r[1]
        chi2 += g0 * r[0] + g1 * r[1]
        for j in range(6):
            slope[j] += J[0, j] * g0 + J[1, j] * g1
            h0, h1 = w00 * J[0, j] + w01 * J[1, j], w01 * J[0, j] + w11 * J[1, j]
            for k in range(j + 1):
                information[j, k] += h0 * J[0, k] + h1 * J[1, k]
    for j in range(6):
        for k in range(j):
            information[k, j] = information[j, k]
    return chi2


@numba.njit(
    (TABLE, TABLE, TABLE, CUBE, numba.float64, OUT_1, OUT_2, OUT_2, OUT_2),
    cache=True,
    error_model="numpy",
)
def refine(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    f: float,
    p: Array,
    R: Array,
    information: Array,
    residuals: Array,
) -> float:
    """Maximum likelihood from a start; gives χ², NaN if it leaves the space before the camera.

    Args:
        leds: (m, 3) in b [m].
        flat: (m, 2) undistorted image coordinates.
        shifts: (m, 3) added to each LED's place in c [m]; zero without rolling shutter.
        weights: (m, 2, 2) inverse covariances of f times `flat` [1/px²].
        f: Focal length that makes residuals pixels.
        p: p_bc_in_c (3,), start and answer.
        R: R_cb (3, 3), start and answer.
        information: (6, 6) of (δp in c, θ in b) with R = R̂ Exp(θ), written.
        residuals: (m, 2) [px], written.
    """
    step, L = np.empty(6), np.empty((6, 6))
    turn, turned = np.empty((3, 3)), np.empty((3, 3))
    for _ in range(ITERATIONS):
        if not _gather(leds, flat, shifts, weights, f, p, R, information, step, residuals) >= 0.0:
            return np.nan
        L[:] = information
        if not cholesky(L, 0.0):
            return np.nan
        solve_by(L, step)
        size = sqrt((step * step).sum())
        if size > LONGEST_STEP:
            step *= 0.5 * LONGEST_STEP / size
        put_moved(p, R, step, turn, p, turned)
        R[:] = turned
        if size * size < CONVERGED:
            break
    chi2 = _gather(leds, flat, shifts, weights, f, p, R, information, step, residuals)
    return chi2 if abs(p[0]) + abs(p[1]) + abs(p[2]) < 1e9 else np.nan
