"""Compiled: the pose that explains named spots best, free or near a known attitude."""

from __future__ import annotations

from math import acos, sqrt

import numpy as np

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array
from pipeline.identification.projection_kernels import put_jacobian, put_moved
from pipeline.jit import numba
from pipeline.linear_kernels import cholesky, solve_by

kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
"""Compiled at the first call, then cached; threads run it side by side."""
FREE, TILT, TURN = 0, 1, 2
"""What is known of the attitude: nothing; the body's z to a limit; the whole of it to a limit."""
ITERATIONS = 12
WALL_PX = 3000.0
"""Per radian beyond the limit: a twentieth of a degree costs some pixels."""
SCRATCH = 197
"""Numbers that a fit of at most 16 LEDs needs."""
HOPELESS = 2.0
"""Times the best so far: what a linear step still promises, when a fit is given up."""


@kernel
def beyond(R: Array, R_true: Array, known: int, limit: float, gradient: Array) -> float:
    """How far [rad] an attitude is outside what is known (negative inside), by θ of R Exp(θ)."""
    if known == TILT:
        cosine = R[0, 2] * R_true[0, 2] + R[1, 2] * R_true[1, 2] + R[2, 2] * R_true[2, 2]
        angle = acos(min(1.0, max(-1.0, cosine)))
        sine = max(1e-9, sqrt(max(0.0, 1.0 - cosine * cosine)))
        v0 = R[0, 0] * R_true[0, 2] + R[1, 0] * R_true[1, 2] + R[2, 0] * R_true[2, 2]
        v1 = R[0, 1] * R_true[0, 2] + R[1, 1] * R_true[1, 2] + R[2, 1] * R_true[2, 2]
        gradient[0], gradient[1], gradient[2] = v1 / sine, -v0 / sine, 0.0
        return angle - limit
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += R[i, j] * R_true[i, j]
    cosine = min(1.0, max(-1.0, 0.5 * (trace - 1.0)))
    angle = acos(cosine)
    sine = 2.0 * max(1e-9, sqrt(1.0 - cosine * cosine))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        difference = 0.0
        for m in range(3):
            difference += R_true[m, j] * R[m, i] - R_true[m, i] * R[m, j]
        gradient[k] = difference / sine
    return angle - limit


@kernel
def _errors(
    leds: Array, px: Array, f: float, R: Array, p: Array, q: Array, residuals: Array
) -> float:
    """Sum of squares [px²]; residuals (m, 2) and points q (m, 3) in c are left behind."""
    total = 0.0
    for k in range(leds.shape[0]):
        for i in range(3):
            q[k, i] = p[i]
            for j in range(3):
                q[k, i] += R[i, j] * leds[k, j]
        if not q[k, 0] > NEAREST_M:
            return np.inf
        residuals[k, 0] = px[k, 0] + f * q[k, 1] / q[k, 0]
        residuals[k, 1] = px[k, 1] + f * q[k, 2] / q[k, 0]
        total += residuals[k, 0] ** 2 + residuals[k, 1] ** 2
    return total


@kernel
def _add_row(row: Array, residual: float, H: Array, g: Array) -> None:
    for i in range(6):
        g[i] += row[i] * residual
        for j in range(i + 1):
            H[i, j] += row[i] * row[j]


@kernel
def _put_normal(
    leds: Array, f: float, R: Array, q: Array, residuals: Array, H: Array, g: Array, J: Array
) -> None:
    """Normal equations of (δp in c, θ in b): lower H (6, 6) and g (6,)."""
    H[:], g[:] = 0.0, 0.0
    for k in range(leds.shape[0]):
        x = q[k, 0]
        put_jacobian(x, q[k, 1] / x, q[k, 2] / x, R, leds[k], -f, J)
        for side in range(2):
            _add_row(J[side], residuals[k, side], H, g)


@kernel
def _solve(H: Array, g: Array, damping: float, L: Array, step: Array) -> bool:
    """H step = g by Cholesky with a share of the diagonal added."""
    L[:], step[:] = H, g
    for i in range(6):
        L[i, i] *= 1.0 + damping
    if not cholesky(L, 0.0):
        return False
    solve_by(L, step)
    return True


@kernel
def _wall(
    R: Array, R_true: Array, known: int, limit: float, row: Array, H: Array, g: Array
) -> float:
    """Cost of being beyond what is known [px²]; its row joins the normal equations."""
    if known == FREE:
        return 0.0
    row[:3] = 0.0
    excess = beyond(R, R_true, known, limit, row[3:])
    if excess <= 0.0:
        return 0.0
    for k in range(3, 6):
        row[k] *= WALL_PX
    _add_row(row, -WALL_PX * excess, H, g)
    return (WALL_PX * excess) ** 2


@kernel
def _cost(
    leds: Array,
    px: Array,
    f: float,
    R: Array,
    p: Array,
    R_true: Array,
    known: int,
    limit: float,
    q: Array,
    residuals: Array,
    row: Array,
) -> float:
    """Sum of squares and what being beyond what is known costs [px²]."""
    cost = _errors(leds, px, f, R, p, q, residuals)
    if known != FREE and np.isfinite(cost):
        cost += (WALL_PX * max(0.0, beyond(R, R_true, known, limit, row))) ** 2
    return cost


@kernel
def refine(
    leds: Array,
    px: Array,
    f: float,
    R: Array,
    p: Array,
    R_true: Array,
    known: int,
    limit: float,
    enough: float,
    work: Array,
) -> float:
    """Least sum of squares [px²] from a start (R, p), which it moves; inf when given up.

    `leds` (m, 3) [m] are seen at `px` (m, 2): tangents (right, down) times the focal length `f`.
    The attitude is `known` to be near `R_true` to a `limit` [rad]. Whatever stays far above
    `enough` [px²] is given up. `work` (`SCRATCH`,) is scratch.
    """
    m = leds.shape[0]
    H, L = work[0:36].reshape(6, 6), work[36:72].reshape(6, 6)
    g, step, p_new = work[72:78], work[78:84], work[84:87]
    J = work[87:99].reshape(2, 6)
    R_new, turn = work[99:108].reshape(3, 3), work[108:117].reshape(3, 3)
    q = work[117 : 117 + 3 * m].reshape(m, 3)
    residuals = work[165 : 165 + 2 * m].reshape(m, 2)
    row = J[0]
    damping, cost = 1e-6, np.inf
    light = _errors(leds, px, f, R, p, q, residuals)
    for iteration in range(ITERATIONS if light < np.inf else 0):
        _put_normal(leds, f, R, q, residuals, H, g, J)
        cost = light + _wall(R, R_true, known, limit, row, H, g)
        if not _solve(H, g, damping, L, step):
            return cost
        promised = cost
        for i in range(6):
            promised -= step[i] * g[i]
        if iteration > 0 and promised > HOPELESS * HOPELESS * enough:
            return np.inf
        if cost - promised < 1e-6 * cost + 1e-9:
            return cost
        for _ in range(8):
            put_moved(p, R, step, turn, p_new, R_new)
            new = _cost(leds, px, f, R_new, p_new, R_true, known, limit, q, residuals, row)
            if new < cost:
                damping = max(1e-9, 0.1 * damping)
                break
            damping = max(1e-4, 10.0 * damping)
            if not _solve(H, g, damping, L, step):
                return cost
        if not new < cost:
            return cost
        R[:], p[:], cost = R_new, p_new, new
        light = _errors(leds, px, f, R, p, q, residuals)
    return cost
