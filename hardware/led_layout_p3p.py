"""Compiled: poses from which three points are seen along three rays, by Grunert's quartic."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from pipeline.frames import Array

kernel = njit(cache=True, nogil=True, error_model="numpy")
"""Compiled at the first call, then cached; threads run it side by side."""


@kernel
def _cubic_root(b: float, c: float, d: float) -> complex:
    """One root of x³ + b x² + c x + d, the one farthest from cancellation."""
    p, q = c - b * b / 3.0, b * (2.0 * b * b - 9.0 * c) / 27.0 + d
    part = np.sqrt(complex(0.25 * q * q + p * p * p / 27.0))
    plus, minus = -0.5 * q + part, -0.5 * q - part
    cube = plus if abs(plus) > abs(minus) else minus
    if abs(cube) < 1e-300:
        return complex(-b / 3.0)
    u = cube ** (1.0 / 3.0)
    root: complex = u - p / (3.0 * u) - b / 3.0
    return root


@kernel
def put_quartic_roots(a4: float, a3: float, a2: float, a1: float, a0: float, out: Array) -> None:
    """Real parts (4,) of the roots, by Ferrari: of a pair that noise split, the middle."""
    b, c, d, e = a3 / a4, a2 / a4, a1 / a4, a0 / a4
    p = c - 0.375 * b * b
    q = d - 0.5 * b * c + 0.125 * b * b * b
    r = e - 0.25 * b * d + 0.0625 * b * b * c - 3.0 / 256.0 * b * b * b * b
    m = _cubic_root(p, 0.25 * p * p - r, -0.125 * q * q)
    w = np.sqrt(2.0 * m)
    if abs(w) < 1e-12:
        inner = np.sqrt(complex(0.25 * p * p - r))
        first, second = np.sqrt(-0.5 * p + inner), np.sqrt(-0.5 * p - inner)
        roots = (first, -first, second, -second)
    else:
        one = np.sqrt(-(2.0 * p + 2.0 * m + 2.0 * q / w))
        two = np.sqrt(-(2.0 * p + 2.0 * m - 2.0 * q / w))
        roots = (0.5 * (w + one), 0.5 * (w - one), 0.5 * (-w + two), 0.5 * (-w - two))
    for k in range(4):
        out[k] = roots[k].real - 0.25 * b


@kernel
def _put_axes(A: Array, axes: Array) -> bool:
    """Orthonormal columns (3, 3) of a triangle with corners A (3, 3); whether it has an area."""
    x0, x1, x2 = A[1, 0] - A[0, 0], A[1, 1] - A[0, 1], A[1, 2] - A[0, 2]
    y0, y1, y2 = A[2, 0] - A[0, 0], A[2, 1] - A[0, 1], A[2, 2] - A[0, 2]
    z0, z1, z2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    long, tall = sqrt(x0 * x0 + x1 * x1 + x2 * x2), sqrt(z0 * z0 + z1 * z1 + z2 * z2)
    if not tall > 1e-12:
        return False
    axes[0, 0], axes[1, 0], axes[2, 0] = x0 / long, x1 / long, x2 / long
    axes[0, 2], axes[1, 2], axes[2, 2] = z0 / tall, z1 / tall, z2 / tall
    axes[0, 1] = axes[1, 2] * axes[2, 0] - axes[2, 2] * axes[1, 0]
    axes[1, 1] = axes[2, 2] * axes[0, 0] - axes[0, 2] * axes[2, 0]
    axes[2, 1] = axes[0, 2] * axes[1, 0] - axes[1, 2] * axes[0, 0]
    return True


@kernel
def _squared(A: Array, i: int, j: int) -> float:
    total = 0.0
    for k in range(3):
        total += (A[i, k] - A[j, k]) ** 2
    return total


@kernel
def _cosine(A: Array, i: int, j: int) -> float:
    return float(A[i, 0] * A[j, 0] + A[i, 1] * A[j, 1] + A[i, 2] * A[j, 2])


@kernel
def _put_quartic(points: Array, rays: Array, out: Array) -> None:
    """The four roots v = s₃ / s₁ of the distances s along the rays."""
    a2, b2, c2 = _squared(points, 1, 2), _squared(points, 0, 2), _squared(points, 0, 1)
    ca, cb, cc = _cosine(rays, 1, 2), _cosine(rays, 0, 2), _cosine(rays, 0, 1)
    k, s = (a2 - c2) / b2, (a2 + c2) / b2
    a, c = a2 / b2, c2 / b2
    a4 = (k - 1.0) ** 2 - 4.0 * c * ca * ca
    a3 = 4.0 * (k * (1.0 - k) * cb - (1.0 - s) * ca * cc + 2.0 * c * ca * ca * cb)
    square = k * k - 1.0 + 2.0 * k * k * cb * cb + 2.0 * (1.0 - c) * ca * ca
    middle = 2.0 * (square - 4.0 * s * ca * cb * cc + 2.0 * (1.0 - a) * cc * cc)
    a1 = 4.0 * (-k * (1.0 + k) * cb + 2.0 * a * cc * cc * cb - (1.0 - s) * ca * cc)
    a0 = (1.0 + k) ** 2 - 4.0 * a * cc * cc
    put_quartic_roots(a4 if abs(a4) > 1e-14 else 1e-14, a3, middle, a1, a0, out)


@kernel
def _put_pose(
    here: Array, there: Array, here_axes: Array, there_axes: Array, R: Array, p: Array
) -> None:
    """What turns and shifts one triangle onto the other."""
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.0
            for m in range(3):
                R[i, j] += there_axes[i, m] * here_axes[j, m]
    for i in range(3):
        turned = 0.0
        for j in range(3):
            turned += R[i, j] * (here[0, j] + here[1, j] + here[2, j])
        p[i] = (there[0, i] + there[1, i] + there[2, i] - turned) / 3.0


@kernel
def put_poses(points: Array, rays: Array, work: Array, R: Array, p: Array) -> int:
    """Poses with q = p + R point along each ray; how many of the four rows are used.

    Args:
        points: (3, 3) [m].
        rays: (3, 3) unit vectors.
        work: (13, 3) scratch.
        R: (4, 3, 3) results.
        p: (4, 3) results [m].
    """
    there, there_axes, here_axes, roots = work[0:3], work[3:6], work[6:9], work[9:13, 0]
    if not _put_axes(points, here_axes):
        return 0
    a2, b2, c2 = _squared(points, 1, 2), _squared(points, 0, 2), _squared(points, 0, 1)
    ca, cb, cc = _cosine(rays, 1, 2), _cosine(rays, 0, 2), _cosine(rays, 0, 1)
    _put_quartic(points, rays, roots)
    k, count = (a2 - c2) / b2, 0
    for root in range(4):
        v = roots[root]
        below = 2.0 * (cc - v * ca)
        u = ((k - 1.0) * v * v - 2.0 * k * cb * v + 1.0 + k) / below
        s = sqrt(b2 / (1.0 + v * v - 2.0 * v * cb))
        twice = root > 0 and v == roots[root - 1]
        if twice or not (v > 0.0 and 0.0 < u < 10.0 and s < 1e3):
            continue
        for i in range(3):
            there[0, i], there[1, i] = s * rays[0, i], s * u * rays[1, i]
            there[2, i] = s * v * rays[2, i]
        if _put_axes(there, there_axes):
            _put_pose(points, there, here_axes, there_axes, R[count], p[count])
            count += 1
    return count
