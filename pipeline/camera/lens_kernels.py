"""Compiled: a lens, from points to pixels and back, with its derivatives.

A lens is a row of numbers `lens` (13,): the model (0 plumb_bob and rational_polynomial, 1
equidistant), fx, fy, cx, cy, then k1, k2, p1, p2, k3, k4, k5, k6, or k1 to k4 of the equidistant.
Points are on the plane one metre ahead: x to the right, y down.
"""

from __future__ import annotations

from math import atan, hypot, tan

import numpy as np

from pipeline.frames import Array
from pipeline.jit import numba
from pipeline.so3_kernels import kernel

LENS = 13
EQUIDISTANT = 1.0
ITERATIONS = 40
CONVERGED = 1e-13
NEAREST_M = 0.1
"""What is nearer to the lens' plane has no place in the picture."""
FARTHEST_RAD = 1.55
"""A ray of an equidistant lens is no farther from its axis."""

VECTOR = numba.types.Array(numba.float64, 1, "A", readonly=True)
TABLE = numba.types.Array(numba.float64, 2, "A", readonly=True)
CUBE = numba.types.Array(numba.float64, 3, "A", readonly=True)
OUT_1 = numba.float64[::1]
OUT_2 = numba.float64[:, ::1]
OUT_3 = numba.float64[:, :, ::1]


@kernel
def bend(lens: Array, x: float, y: float, out: Array) -> None:
    """What distortion makes of a point: out (6,) is x', y', and ∂x'/∂x, ∂x'/∂y, ∂y'/∂x, ∂y'/∂y."""
    k = lens[5:]
    r2 = x * x + y * y
    if lens[0] == EQUIDISTANT:
        r = hypot(x, y)
        if r < 1e-9:
            out[0], out[1], out[2], out[3], out[4], out[5] = x, y, 1.0, 0.0, 0.0, 1.0
            return
        a = atan(r)
        a2 = a * a
        bent = a * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))))
        slope = 1.0 + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * 9.0 * k[3])))
        scale = bent / r
        stretch = (slope / (1.0 + r2) - scale) / r2  # ∂scale/∂(r²/2)
        out[0], out[1] = scale * x, scale * y
        out[2] = scale + stretch * x * x
        out[3] = out[4] = stretch * x * y
        out[5] = scale + stretch * y * y
        return
    top = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    low = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    scale = top / low
    d_top = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4])
    d_low = k[5] + r2 * (2.0 * k[6] + r2 * 3.0 * k[7])
    stretch = 2.0 * (d_top - scale * d_low) / low
    p1, p2 = k[2], k[3]
    out[0] = scale * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    out[1] = scale * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    out[2] = scale + stretch * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    out[3] = out[4] = stretch * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    out[5] = scale + stretch * y * y + 6.0 * p1 * y + 2.0 * p2 * x


@kernel
def unbend(lens: Array, u: float, v: float, out: Array) -> bool:
    """The point (out[:2]) that is seen at a pixel, with `bend`'s derivatives there (out[2:]).

    By Newton's method from where no lens would put it; False if none is found: the nearest is told.
    """
    bent_x, bent_y = (u - lens[3]) / lens[1], (v - lens[4]) / lens[2]
    x, y = bent_x, bent_y
    if lens[0] == EQUIDISTANT:
        a = hypot(bent_x, bent_y)
        if a > 1e-9:
            scale = tan(min(a, FARTHEST_RAD)) / a
            x, y = scale * x, scale * y
    best, best_x, best_y, damping = np.inf, x, y, 1.0
    for _ in range(ITERATIONS):
        bend(lens, x, y, out)
        off_x, off_y = bent_x - out[0], bent_y - out[1]
        off = hypot(off_x, off_y)
        if off < best:
            best, best_x, best_y = off, x, y
            damping = min(1.0, 2.0 * damping)
        else:  # too far: half as far from the best so far
            damping *= 0.5
            x, y = 0.5 * (x + best_x), 0.5 * (y + best_y)
            continue
        if off < CONVERGED:
            break
        det = out[2] * out[5] - out[3] * out[4]
        if not det > 1e-6:
            break
        x += damping * (out[5] * off_x - out[3] * off_y) / det
        y += damping * (out[2] * off_y - out[4] * off_x) / det
    bend(lens, best_x, best_y, out)
    out[0], out[1] = best_x, best_y
    return bool(best < 1e-9)


@numba.njit((VECTOR, TABLE, OUT_2), cache=True, error_model="numpy")
def put_pixels(lens: Array, points_in_c: Array, pixels: Array) -> None:
    """Pixels (n, 2) of points (n, 3) in c, in front of the camera."""
    bent = np.empty(6)
    for i in range(len(points_in_c)):
        q = points_in_c[i]
        bend(lens, -q[1] / q[0], -q[2] / q[0], bent)
        pixels[i, 0] = lens[1] * bent[0] + lens[3]
        pixels[i, 1] = lens[2] * bent[1] + lens[4]


@numba.njit((VECTOR, TABLE, OUT_2), cache=True, error_model="numpy")
def put_normalised(lens: Array, pixels: Array, flat: Array) -> None:
    """Points (n, 2) on the plane one metre ahead that are seen at pixels (n, 2)."""
    bent = np.empty(6)
    for i in range(len(pixels)):
        unbend(lens, pixels[i, 0], pixels[i, 1], bent)
        flat[i, 0], flat[i, 1] = bent[0], bent[1]


@kernel
def put_slope(lens: Array, bent: Array, slope: Array) -> None:
    """(2, 2) derivative of the point by its pixel [1/px], from `unbend`'s answer."""
    det = bent[2] * bent[5] - bent[3] * bent[4]
    slope[0, 0], slope[0, 1] = bent[5] / det / lens[1], -bent[3] / det / lens[2]
    slope[1, 0], slope[1, 1] = -bent[4] / det / lens[1], bent[2] / det / lens[2]


@numba.njit((VECTOR, TABLE, OUT_3), cache=True, error_model="numpy")
def put_slopes(lens: Array, pixels: Array, slopes: Array) -> None:
    """`put_slope` (n, 2, 2) at pixels (n, 2)."""
    bent = np.empty(6)
    for i in range(len(pixels)):
        unbend(lens, pixels[i, 0], pixels[i, 1], bent)
        put_slope(lens, bent, slopes[i])


@numba.njit((VECTOR, TABLE, CUBE, numba.float64, OUT_2, OUT_3), cache=True, error_model="numpy")
def put_tangents(
    lens: Array, pixels: Array, covariances: Array, scale: float, tangents: Array, claimed: Array
) -> None:
    """Tangents (n, 2) to the left and up of pixels, and their covariances (n, 2, 2).

    Args:
        lens: As above.
        pixels: (n, 2).
        covariances: (n, 2, 2) [px²], symmetric.
        scale: By how much they are too small.
        tangents: Written.
        claimed: Written.
    """
    bent, S = np.empty(6), np.empty((2, 2))
    for i in range(len(pixels)):
        unbend(lens, pixels[i, 0], pixels[i, 1], bent)
        tangents[i, 0], tangents[i, 1] = -bent[0], -bent[1]
        put_slope(lens, bent, S)
        for a in range(2):
            for b in range(2):
                c = 0.0
                for j in range(2):
                    for k in range(2):
                        c += S[a, j] * covariances[i, j, k] * S[b, k]
                claimed[i, a, b] = scale * c
