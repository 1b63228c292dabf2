"""Compiled P3P: the up to four poses from which three points are seen along three rays.

Grunert's solution (1841) as Haralick, Lee, Ottenberg and Nölle review it (Int. J. Computer Vision
13 (1994) 331): a quartic in the ratio of two distances.
"""

from __future__ import annotations

from math import acos, cos, sqrt

import numpy as np

from pipeline.frames import Array
from pipeline.so3_kernels import kernel


@kernel
def _cubic_root(b: float, c: float, d: float) -> float:
    """The largest real root of x³ + b x² + c x + d."""
    q, r = (b * b - 3.0 * c) / 9.0, (2.0 * b**3 - 9.0 * b * c + 27.0 * d) / 54.0
    if r * r < q**3:
        x = 2.0 * sqrt(q) * cos(acos(-r / sqrt(q**3)) / 3.0) - b / 3.0
    else:
        s = -np.sign(r) * (abs(r) + sqrt(max(r * r - q**3, 0.0))) ** (1.0 / 3.0)
        x = s + (q / s if s != 0.0 else 0.0) - b / 3.0
    for _ in range(2):
        slope = (3.0 * x + 2.0 * b) * x + c
        if slope != 0.0:
            x -= (((x + b) * x + c) * x + d) / slope
    return x


@kernel
def quartic_roots(a: Array, split: float, roots: Array) -> int:
    """Real roots of a₄x⁴ + a₃x³ + … + a₀ by Ferrari; how many.

    What is measured is never exact: of a complex pair, the real part counts twice, unless the
    pair's discriminant is below −`split` times its terms (0: of no pair, inf: of every pair).
    """
    if abs(a[4]) < 1e-14:
        return 0
    b, c, d, e = a[3] / a[4], a[2] / a[4], a[1] / a[4], a[0] / a[4]
    p = c - 0.375 * b * b
    q = d - 0.5 * b * c + 0.125 * b**3
    r = e - 0.25 * b * d + 0.0625 * b * b * c - 3.0 / 256.0 * b**4
    m2 = max(_cubic_root(2.0 * p, p * p - 4.0 * r, -q * q), 0.0)
    m = sqrt(m2)
    count = 0
    for sign in (-1.0, 1.0):
        if m > 1e-9:
            rest = 0.5 * (p + m2 + sign * q / m)
        else:
            rest = 0.5 * p + sign * 0.5 * sqrt(max(p * p - 4.0 * r, 0.0))
        # y² − sign m y + rest
        under = m2 - 4.0 * rest
        if under < -split * (m2 + 4.0 * abs(rest)):
            continue
        spread = sqrt(max(under, 0.0))
        roots[count] = 0.5 * (sign * m + spread) - 0.25 * b
        roots[count + 1] = 0.5 * (sign * m - spread) - 0.25 * b
        count += 2
    return count


@kernel
def put_triad(p1: Array, p2: Array, p3: Array, out: Array) -> None:
    """Columns: along p2 − p1, normal to the triangle, and the third."""
    x0, x1, x2 = p2[0] - p1[0], p2[1] - p1[1], p2[2] - p1[2]
    y0, y1, y2 = p3[0] - p1[0], p3[1] - p1[1], p3[2] - p1[2]
    z0, z1, z2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    nx, nz = sqrt(x0 * x0 + x1 * x1 + x2 * x2), sqrt(z0 * z0 + z1 * z1 + z2 * z2)
    x0, x1, x2, z0, z1, z2 = x0 / nx, x1 / nx, x2 / nx, z0 / nz, z1 / nz, z2 / nz
    out[0, 0], out[1, 0], out[2, 0] = x0, x1, x2
    out[0, 1], out[1, 1], out[2, 1] = z0, z1, z2
    out[0, 2], out[1, 2], out[2, 2] = x1 * z2 - x2 * z1, x2 * z0 - x0 * z2, x0 * z1 - x1 * z0


@kernel
def _dot(a: Array, b: Array) -> float:
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@kernel
def _quartic(rays: Array, points: Array, A: Array) -> tuple[float, float, float]:
    """Grunert's coefficients (5,); returns (a² − c²) / b², b² and the cosine between rays 0, 2."""
    a2 = b2 = c2 = 0.0
    for i in range(3):
        a2 += (points[1, i] - points[2, i]) ** 2
        b2 += (points[0, i] - points[2, i]) ** 2
        c2 += (points[0, i] - points[1, i]) ** 2
    ca, cb, cg = _dot(rays[1], rays[2]), _dot(rays[0], rays[2]), _dot(rays[0], rays[1])
    k, s, ab, cb2 = (a2 - c2) / b2, (a2 + c2) / b2, a2 / b2, c2 / b2
    A[4] = (k - 1.0) ** 2 - 4.0 * cb2 * ca * ca
    A[3] = 4.0 * (k * (1.0 - k) * cb - (1.0 - s) * ca * cg + 2.0 * cb2 * ca * ca * cb)
    A[2] = 2.0 * (
        k * k
        - 1.0
        + 2.0 * k * k * cb * cb
        + 2.0 * (1.0 - cb2) * ca * ca
        - 4.0 * s * ca * cb * cg
        + 2.0 * (1.0 - ab) * cg * cg
    )
    A[1] = 4.0 * (-k * (1.0 + k) * cb + 2.0 * ab * cg * cg * cb - (1.0 - s) * ca * cg)
    A[0] = (1.0 + k) ** 2 - 4.0 * ab * cg * cg
    return k, b2, cb


@kernel
def p3p(rays: Array, points: Array, triad: Array, split: float, ps: Array, Rs: Array) -> int:
    """Poses (ps (4, 3), Rs (4, 3, 3)) of three points in b seen along unit rays in c; how many.

    Grunert's quartic (Haralick et al. 1994) in the ratio v of the third distance to the first; u is
    that of the second.

    Args:
        rays: (3, 3) unit vectors by rows.
        points: (3, 3) in b, by rows.
        triad: `put_triad` of the points.
        split: How far noise may have split a pair of roots, as `quartic_roots` takes it.
        ps: Places, written.
        Rs: Attitudes, written.
    """
    A, roots, corners, seen = np.empty(5), np.empty(4), np.empty((3, 3)), np.empty((3, 3))
    k, b2, cb = _quartic(rays, points, A)
    ca, cg = _dot(rays[1], rays[2]), _dot(rays[0], rays[1])
    count = 0
    for root in range(quartic_roots(A, split, roots)):
        v = roots[root]
        below = 2.0 * (cg - v * ca)
        if not v > 0.0 or abs(below) < 1e-12:
            continue
        u = ((k - 1.0) * v * v - 2.0 * k * cb * v + 1.0 + k) / below
        if not u > 0.0:
            continue
        first = sqrt(b2 / (1.0 + v * v - 2.0 * v * cb))
        for i in range(3):
            corners[0, i] = first * rays[0, i]
            corners[1, i] = u * first * rays[1, i]
            corners[2, i] = v * first * rays[2, i]
        put_triad(corners[0], corners[1], corners[2], seen)
        for i in range(3):
            for j in range(3):
                Rs[count, i, j] = _dot(seen[i], triad[j])
        for i in range(3):
            ps[count, i] = 0.0
            for m in range(3):  # of a split pair, no place fits all three: the mean does best
                ps[count, i] += (corners[m, i] - _dot(Rs[count, i], points[m])) / 3.0
        count += 1
    return count
