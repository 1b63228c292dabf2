"""Compiled: the pose that named LEDs are most likely seen from, by Gauss-Newton.

Rows of a rolling shutter were carried to one time by a velocity that is known to `sigma_u`: what it
is off by is solved for with the pose, known beforehand as well as that, and marginalised (Schur
complement). Else it would be taken for noise of the spots, and for a pose.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.camera.lens_kernels import CUBE, NEAREST_M, OUT_1, OUT_2, TABLE, VECTOR
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
def _marginalise(
    S: Array, B: Array, h: Array, information: Array, slope: Array, velocity: Array
) -> float:
    """Take a velocity out of normal equations; gives by how much χ² falls, NaN if it can't be.

    Args:
        S: (3, 3) its information, becomes its factor.
        B: (6, 3) its information with the pose's.
        h: (3,) its slope.
        information: (6, 6) of the pose, its lower half becomes the marginal one.
        slope: (6,) of the pose, becomes that with the best velocity.
        velocity: (3,) the best for the pose as it is, written [m/s].
    """
    if not cholesky(S, 0.0):
        return np.nan
    velocity[:] = h
    solve_by(S, velocity)
    row = np.empty(3)
    for j in range(6):
        row[:] = B[j]
        solve_by(S, row)
        slope[j] -= (B[j] * velocity).sum()
        for k in range(j + 1):
            information[j, k] -= (row * B[k]).sum()
    fall: float = (h * velocity).sum()
    return fall


@kernel
def _gather(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    delays: Array,
    sigma_u: float,
    f: float,
    p: Array,
    R: Array,
    information: Array,
    slope: Array,
    residuals: Array,
    velocity: Array,
) -> float:
    """Normal equations and residuals (m, 2); gives χ², NaN if an LED is not in front."""
    information[:], slope[:], velocity[:] = 0.0, 0.0, 0.0
    J, chi2, rolls = np.empty((2, 6)), 0.0, False
    S, B, h = np.zeros((3, 3)), np.zeros((6, 3)), np.zeros(3)
    for i in range(len(leds)):
        r = residuals[i]
        if not put_residual(leds[i], flat[i], shifts[i], f, p, R, r, J):
            return np.nan
        w00, w01, w11 = weights[i, 0, 0], weights[i, 0, 1], weights[i, 1, 1]
        g0, g1 = w00 * r[0] + w01 * r[1], w01 * r[0] + w11 * r[1]
        chi2 += g0 * r[0] + g1 * r[1]
        delay = delays[i]
        rolls = rolls or delay != 0.0
        for j in range(6):
            g = J[0, j] * g0 + J[1, j] * g1
            slope[j] += g
            h0, h1 = w00 * J[0, j] + w01 * J[1, j], w01 * J[0, j] + w11 * J[1, j]
            for k in range(j + 1):
                information[j, k] += h0 * J[0, k] + h1 * J[1, k]
            if delay == 0.0:
                continue
            for k in range(3):  # a velocity moves p by itself times the delay
                both = delay * (h0 * J[0, k] + h1 * J[1, k])
                B[j, k] += both
                if j < 3:
                    S[j, k] += delay * both
            if j < 3:
                h[j] += delay * g
    if rolls and sigma_u > 0.0:
        for k in range(3):
            S[k, k] += 1.0 / (sigma_u * sigma_u)
        chi2 -= _marginalise(S, B, h, information, slope, velocity)
    for j in range(6):
        for k in range(j):
            information[k, j] = information[j, k]
    return chi2


@numba.njit(
    (
        TABLE, TABLE, TABLE, CUBE, VECTOR, numba.float64, numba.float64,
        OUT_1, OUT_2, OUT_2, OUT_2,
    ),
    cache=True,
    error_model="numpy",
)  # fmt: skip
def refine(
    leds: Array,
    flat: Array,
    shifts: Array,
    weights: Array,
    delays: Array,
    sigma_u: float,
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
        delays: (m,) of each LED's row after the middle one [s]; zero without rolling shutter.
        sigma_u: Of the velocity behind `shifts`, in each axis [m/s].
        f: Focal length that makes residuals pixels.
        p: p_bc_in_c (3,), start and answer.
        R: R_cb (3, 3), start and answer.
        information: (6, 6) of (δp in c, θ in b) with R = R̂ Exp(θ), written.
        residuals: (m, 2) [px], written.
    """
    step, L, velocity, J = np.empty(6), np.empty((6, 6)), np.empty(3), np.empty((2, 6))
    turn, turned = np.empty((3, 3)), np.empty((3, 3))
    for _ in range(ITERATIONS):
        chi2 = _gather(
            leds, flat, shifts, weights, delays, sigma_u, f, p, R, information, step, residuals,
            velocity,
        )  # fmt: skip
        if not chi2 >= 0.0:
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
    chi2 = _gather(
        leds, flat, shifts, weights, delays, sigma_u, f, p, R, information, step, residuals,
        velocity,
    )  # fmt: skip
    for i in range(len(leds)):  # what the velocity explains is no residual
        if delays[i] != 0.0 and put_residual(leds[i], flat[i], shifts[i], f, p, R, residuals[i], J):
            for k in range(3):
                residuals[i, 0] -= delays[i] * J[0, k] * velocity[k]
                residuals[i, 1] -= delays[i] * J[1, k] * velocity[k]
    return chi2 if abs(p[0]) + abs(p[1]) + abs(p[2]) < 1e9 else np.nan
