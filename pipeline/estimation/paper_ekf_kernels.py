"""The compiled arithmetic of `paper_ekf`: what `relative_model` says, without its zeros.

Twelve rows of the Jacobian are not zero (p, η, v, ω_c) and they touch the first 24 states only.
Every kernel works in place on x (30,) and P (30, 30); P stays symmetric to the last bit because
both halves are computed by the same operations. Work arrays come from `workspace`.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from pipeline.frames import Array
from pipeline.so3_kernels import kernel

N, MOVING, TOUCHED = 30, 12, 24
"""States; those with a derivative; those a derivative depends on."""
DELTA = 21
"""First state of δ_c."""
MOVING_STATE = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14])
MIN_COS_PITCH = 0.02
"""Nearer than 1.1° to the singularity of roll, pitch, yaw the kernels give up."""
BODY, PHONE = 0, 1
"""Kinds of IMU."""
MEASURED = np.array(
    [
        [[9, 24], [10, 25], [11, 26], [15, 27], [16, 28], [17, 29]],
        [[12, -1], [13, -1], [14, -1], [18, -1], [19, -1], [20, -1]],
    ]
)
"""(kind, component, 2): a gyroscope and accelerometer read the sum of these states. Eq. (9)."""


def workspace() -> Array:
    """Scratch memory of the kernels (rows of 30); its content never matters between calls."""
    return np.zeros((4 * MOVING + TOUCHED, N))


@kernel
def derivative(x: Array, dx: Array) -> None:
    """ẋ of the moving states into dx (12,): p, η, v, ω_c. Eq. (3), (7), (8), (11)."""
    sr, cr, sp, cp, sy, cy = sin(x[3]), cos(x[3]), sin(x[4]), cos(x[4]), sin(x[5]), cos(x[5])
    b0, b1, b2 = x[9], x[10], x[11]
    c0, c1, c2 = x[12], x[13], x[14]
    d0, d1, d2 = x[21], x[22], x[23]
    along = (sr * b1 + cr * b2 - sp * (cy * c0 + sy * c1)) / cp
    dx[0], dx[1], dx[2] = x[6], x[7], x[8]
    dx[3] = b0 + sp * (sr * b1 + cr * b2) / cp - (cy * c0 + sy * c1) / cp
    dx[4] = cr * b1 - sr * b2 + sy * c0 - cy * c1
    dx[5] = along - c2
    # ω×(2v + ω×p) + δ×p: Coriolis, centrifugal and Euler terms together
    e0 = 2.0 * x[6] + c1 * x[2] - c2 * x[1]
    e1 = 2.0 * x[7] + c2 * x[0] - c0 * x[2]
    e2 = 2.0 * x[8] + c0 * x[1] - c1 * x[0]
    f0, f1, f2 = x[15], cr * x[16] - sr * x[17], sr * x[16] + cr * x[17]
    g0, g2 = cp * f0 + sp * f2, cp * f2 - sp * f0
    dx[6] = cy * g0 - sy * f1 - x[18] - (c1 * e2 - c2 * e1) - (d1 * x[2] - d2 * x[1])
    dx[7] = sy * g0 + cy * f1 - x[19] - (c2 * e0 - c0 * e2) - (d2 * x[0] - d0 * x[2])
    dx[8] = g2 - x[20] - (c0 * e1 - c1 * e0) - (d0 * x[1] - d1 * x[0])
    dx[9], dx[10], dx[11] = d0, d1, d2


@kernel
def _put_skew(A: Array, row: int, column: int, k: float, v0: float, v1: float, v2: float) -> None:
    """A[3, 3 block] += k [v]×."""
    A[row, column + 1] -= k * v2
    A[row, column + 2] += k * v1
    A[row + 1, column] += k * v2
    A[row + 1, column + 2] -= k * v0
    A[row + 2, column] -= k * v1
    A[row + 2, column + 1] += k * v0


@kernel
def _put_skew_skew(A: Array, row: int, column: int, a: Array, b: Array, k: float) -> None:
    """A[3, 3 block] += k [a]× [b]× = k (b aᵀ − (a·b) I)."""
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    for i in range(3):
        for j in range(3):
            A[row + i, column + j] += k * b[i] * a[j]
        A[row + i, column + i] -= k * dot


@kernel
def jacobian(x: Array, A: Array) -> None:
    """∂ẋ/∂x of the moving states into A (12, 24): rows p, η, v, ω_c."""
    for i in range(MOVING):
        for j in range(TOUCHED):
            A[i, j] = 0.0
    p, v, w = x[0:3], x[6:9], x[12:15]
    _put_rotation_rates(x, A)
    _put_rotated_force(x, A)
    for i in range(3):
        A[i, 6 + i] = 1.0
        A[6 + i, 18 + i] = -1.0
        A[9 + i, DELTA + i] = 1.0
    _put_skew(A, 6, 0, -1.0, x[21], x[22], x[23])
    _put_skew_skew(A, 6, 0, w, w, -1.0)
    _put_skew(A, 6, 6, -2.0, w[0], w[1], w[2])
    c0, c1, c2 = w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]
    _put_skew(A, 6, 12, 1.0, 2.0 * v[0] + c0, 2.0 * v[1] + c1, 2.0 * v[2] + c2)
    _put_skew_skew(A, 6, 12, w, p, 1.0)
    _put_skew(A, 6, DELTA, 1.0, p[0], p[1], p[2])


@kernel
def _put_rotation_rates(x: Array, A: Array) -> None:
    """Rows of η̇ = ^bS⁻¹ ω_b − ^cS⁻¹ ω_c. Eq. (3), (7)."""
    sr, cr, sy, cy = sin(x[3]), cos(x[3]), sin(x[5]), cos(x[5])
    k = 1.0 / cos(x[4])
    t = k * sin(x[4])
    along_b, across_b = sr * x[10] + cr * x[11], cr * x[10] - sr * x[11]
    along_c, across_c = cy * x[12] + sy * x[13], cy * x[13] - sy * x[12]
    A[3, 3], A[4, 3], A[5, 3] = t * across_b, -along_b, k * across_b
    A[3, 4] = k * k * along_b - k * t * along_c
    A[5, 4] = k * t * along_b - k * k * along_c
    A[3, 5], A[4, 5], A[5, 5] = -k * across_c, along_c, -t * across_c
    A[3, 9], A[3, 10], A[3, 11] = 1.0, sr * t, cr * t
    A[4, 10], A[4, 11] = cr, -sr
    A[5, 10], A[5, 11] = sr * k, cr * k
    A[3, 12], A[3, 13] = -cy * k, -sy * k
    A[4, 12], A[4, 13] = sy, -cy
    A[5, 12], A[5, 13], A[5, 14] = -cy * t, -sy * t, -1.0


@kernel
def rotation(x: Array, R: Array, row: int, column: int) -> None:
    """^cR_b of the state into R[row:row + 3, column:column + 3]."""
    sr, cr, sp, cp, sy, cy = sin(x[3]), cos(x[3]), sin(x[4]), cos(x[4]), sin(x[5]), cos(x[5])
    R[row, column], R[row + 1, column], R[row + 2, column] = cy * cp, sy * cp, -sp
    R[row, column + 1] = cy * sp * sr - sy * cr
    R[row + 1, column + 1] = sy * sp * sr + cy * cr
    R[row + 2, column + 1] = cp * sr
    R[row, column + 2] = cy * sp * cr + sy * sr
    R[row + 1, column + 2] = sy * sp * cr - cy * sr
    R[row + 2, column + 2] = cp * cr


@kernel
def _put_rotated_force(x: Array, A: Array) -> None:
    """∂(^cR_b a_b) by a_b and by η, whose columns are axis × (^cR_b a_b)."""
    rotation(x, A, 6, 15)
    f0, f1, f2 = 0.0, 0.0, 0.0
    for j in range(3):
        f0 += A[6, 15 + j] * x[15 + j]
        f1 += A[7, 15 + j] * x[15 + j]
        f2 += A[8, 15 + j] * x[15 + j]
    sy, cy = sin(x[5]), cos(x[5])
    r0, r1, r2 = A[6, 15], A[7, 15], A[8, 15]
    A[6, 3], A[7, 3], A[8, 3] = r1 * f2 - r2 * f1, r2 * f0 - r0 * f2, r0 * f1 - r1 * f0
    A[6, 4], A[7, 4], A[8, 4] = cy * f2, sy * f2, -sy * f1 - cy * f0
    A[6, 5], A[7, 5] = -f1, f0


@kernel
def rk4(x: Array, h: float, work: Array) -> None:
    """Carry the state on by `h` seconds. Eq. (11)."""
    k, y, total = work[0], work[1], work[2]
    for i in range(N):
        y[i] = x[i]
    for i in range(MOVING):
        total[i] = 0.0
    for stage in range(4):
        derivative(y, k)
        weight = 1.0 if stage == 0 or stage == 3 else 2.0
        reach = h if stage == 2 else 0.5 * h
        for i in range(MOVING):
            total[i] += weight * k[i]
            y[MOVING_STATE[i]] = x[MOVING_STATE[i]] + reach * k[i]
    for i in range(MOVING):
        x[MOVING_STATE[i]] += h / 6.0 * total[i]


@kernel
def transition(x: Array, h: float, A: Array, Phi: Array) -> None:
    """Moving rows of I + hA + h²A²/2 into Phi (12, 24); A (12, 24) is overwritten."""
    jacobian(x, A)
    for i in range(MOVING):
        for k in range(TOUCHED):
            Phi[i, k] = h * A[i, k]
        for j in range(MOVING):
            a = 0.5 * h * h * A[i, MOVING_STATE[j]]
            if a != 0.0:
                for k in range(TOUCHED):
                    Phi[i, k] += a * A[j, k]
        Phi[i, MOVING_STATE[i]] += 1.0


@kernel
def spread(P: Array, Phi: Array, work: Array) -> None:
    """P ← Φ P Φᵀ, for the rows and columns of the moving states."""
    T, S, Phi_T = work[0:MOVING], work[MOVING : 2 * MOVING], work[2 * MOVING : 2 * MOVING + TOUCHED]
    for i in range(MOVING):
        for k in range(N):
            T[i, k] = 0.0
        for j in range(TOUCHED):
            f = Phi[i, j]
            Phi_T[j, i] = f
            if f != 0.0:
                for k in range(N):
                    T[i, k] += f * P[j, k]
    for i in range(MOVING):
        for j in range(MOVING):
            S[i, j] = 0.0
        for k in range(TOUCHED):
            f = T[i, k]
            for j in range(MOVING):
                S[i, j] += f * Phi_T[k, j]
    for i in range(MOVING):
        for k in range(N):
            P[MOVING_STATE[i], k] = T[i, k]
            P[k, MOVING_STATE[i]] = T[i, k]
    for i in range(MOVING):
        for j in range(i + 1):
            P[MOVING_STATE[i], MOVING_STATE[j]] = S[i, j]
            P[MOVING_STATE[j], MOVING_STATE[i]] = S[i, j]
