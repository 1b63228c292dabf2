"""Compiled rotations: (3, 3) and (3,) arithmetic into memory that the caller owns."""

from __future__ import annotations

from math import acos, cos, sin, sqrt

from pipeline.frames import Array
from pipeline.jit import numba

kernel = numba.njit(cache=True, error_model="numpy")
"""Compiled at the first call, then cached; a division by zero gives inf, not an exception."""


@kernel
def put_exp(v0: float, v1: float, v2: float, R: Array) -> None:
    """R (3, 3) = Exp(v)."""
    n2 = v0 * v0 + v1 * v1 + v2 * v2
    if n2 < 1e-8:
        s, k = 1.0 - n2 / 6.0, 0.5 - n2 / 24.0
    else:
        n = sqrt(n2)
        s, k = sin(n) / n, (1.0 - cos(n)) / n2
    R[0, 0], R[1, 1], R[2, 2] = (
        1.0 - k * (v1 * v1 + v2 * v2),
        1.0 - k * (v0 * v0 + v2 * v2),
        1.0 - k * (v0 * v0 + v1 * v1),
    )
    R[0, 1], R[1, 0] = k * v0 * v1 - s * v2, k * v0 * v1 + s * v2
    R[0, 2], R[2, 0] = k * v0 * v2 + s * v1, k * v0 * v2 - s * v1
    R[1, 2], R[2, 1] = k * v1 * v2 - s * v0, k * v1 * v2 + s * v0


@kernel
def multiply(A: Array, B: Array, C: Array) -> None:
    """C = A B, all (3, 3), C neither A nor B."""
    for i in range(3):
        for j in range(3):
            C[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@kernel
def turn(A: Array, v: Array, out: Array) -> None:
    """out = A v, out not v."""
    for i in range(3):
        out[i] = A[i, 0] * v[0] + A[i, 1] * v[1] + A[i, 2] * v[2]


@kernel
def times_skew(A: Array, v: Array, C: Array) -> None:
    """C = A [v]×, C not A."""
    for i in range(3):
        C[i, 0] = A[i, 1] * v[2] - A[i, 2] * v[1]
        C[i, 1] = A[i, 2] * v[0] - A[i, 0] * v[2]
        C[i, 2] = A[i, 0] * v[1] - A[i, 1] * v[0]


@kernel
def put_right_jacobian(v0: float, v1: float, v2: float, J: Array) -> None:
    """J = ∂Exp at v, right: I − [v]×/2 + [v]×²/6, for turns of a few degrees."""
    n2 = v0 * v0 + v1 * v1 + v2 * v2
    J[0, 0], J[1, 1], J[2, 2] = (
        1.0 + (v0 * v0 - n2) / 6.0,
        1.0 + (v1 * v1 - n2) / 6.0,
        1.0 + (v2 * v2 - n2) / 6.0,
    )
    J[0, 1], J[1, 0] = v0 * v1 / 6.0 + 0.5 * v2, v0 * v1 / 6.0 - 0.5 * v2
    J[0, 2], J[2, 0] = v0 * v2 / 6.0 - 0.5 * v1, v0 * v2 / 6.0 + 0.5 * v1
    J[1, 2], J[2, 1] = v1 * v2 / 6.0 + 0.5 * v0, v1 * v2 / 6.0 - 0.5 * v0


@kernel
def largest_sigma(C: Array, k: int) -> float:
    """Square root of the largest eigenvalue of the symmetric C[k:k + 3, k:k + 3]."""
    a, b, c = C[k, k], C[k + 1, k + 1], C[k + 2, k + 2]
    d, e, f = C[k, k + 1], C[k + 1, k + 2], C[k, k + 2]
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    size = sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    if size < 1e-12 * abs(mean):
        return sqrt(mean)
    determinant = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
    angle = acos(min(1.0, max(-1.0, 0.5 * determinant / size**3))) / 3.0
    return sqrt(mean + 2.0 * size * cos(angle))
