"""Compiled soft-window centroid: where a spot is to a hundredth of a pixel, with its covariance.

A centroid in about linear light over a soft elliptical window that follows the spot (by Newton's
method): no pixel counts wholly or not at all, and what is as bright on both sides cancels, whether
it is clipped, bloomed or blurred by motion. The covariance follows from each pixel's variance. An
iteratively weighted centroid, as in Baker & Moallem, Optics Express 15 (2007) 5147.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel

Box = npt.NDArray[np.int64]
U, V, BRIGHTNESS, AREA, CONTRAST, UU, UV, VV, NOISE = range(9)
C_UU, C_UV, C_VV, S_UU, S_UV, S_VV = range(9, 15)
FIELDS = 15
"""A spot's row: place, sum above the ground, pixels, contrast in grey levels, second moments, noise
in grey levels, the covariance of the place as far as it is this spot's own, and what uneven motion
during the exposure adds, which all spots share."""
RING = 3
"""Pixels between a spot's members and the ring that tells its ground."""
EXTENT = 3.7
"""The window has half its weight at this many second moments' ellipse, or about 1.15 times the
radius of a disc."""
LAG, MOST_BEND = 2, 150.0
"""Pixels between those that are compared, and grey levels beyond which it is no noise."""
FEWEST_NOISE = 0.29
"""Of rounding to grey levels."""
MODEL_PX = 0.002
CLIPPED_PX = 0.004
"""Of one clipped pixel: steep edges are seen by few pixels; grows with the fourth root of their
count."""
SLOPE_SHARE = 0.3
"""Of what the ground's slope was worth, for it is no plane."""
DIM, MOST_DIM = 80.0, 4.0
"""Grey levels; with less contrast a codec's steps matter more."""
ROUND_PX, OWN_SMEAR, SHARED_SMEAR = 1.0, 0.001, 0.005
"""A streak longer than a round spot seems moved while exposed, and not evenly: unsure along it, by
these shares of its length."""
ITERATIONS = 6
CONVERGED_PX = 1e-4
FARTHEST_PX = 2.0
"""From where the window started: farther, it has followed another light."""


@kernel
def middle_of(values: Array, n: int) -> float:
    """Median of values[:n], which are put in order."""
    for i in range(1, n):
        x, j = values[i], i - 1
        while j >= 0 and values[j] > x:
            values[j + 1] = values[j]
            j -= 1
        values[j + 1] = x
    return 0.5 * float(values[(n - 1) // 2] + values[n // 2])


@kernel
def ground_of(
    luma: Image, light: Array, left: int, top: int, right: int, bottom: int, out: Array, work: Array
) -> None:
    """The plane of light beneath a spot, from the sides of a box: level, slopes, noise in grey.

    Each side's median, so that a neighbour that reaches into one corner counts for little; the
    noise by second differences, so that a halo's slope is none.
    """
    sides = np.empty(4)
    off, count, dark = 0.0, 0, 0.0
    for side in range(4):
        n = 0
        if side < 2:
            row = top if side == 0 else bottom
            for u in range(left, right + 1):
                work[n] = luma[row, u]
                n += 1
        else:
            column = left if side == 2 else right
            for v in range(top, bottom + 1):
                work[n] = luma[v, column]
                n += 1
        for i in range(LAG, n - LAG):
            bend = abs(work[i - LAG] - 2.0 * work[i] + work[i + LAG])
            if bend < MOST_BEND:
                off += bend * bend / 6.0
                count += 1
        grey = middle_of(work, n)
        dark += 0.25 * grey
        below = int(grey)
        sides[side] = light[below] + (grey - below) * (light[min(below + 1, 255)] - light[below])
    out[0] = 0.25 * (sides[0] + sides[1] + sides[2] + sides[3])
    out[1] = (sides[3] - sides[2]) / (right - left)
    out[2] = (sides[1] - sides[0]) / (bottom - top)
    noise = max(sqrt(off / max(count, 1)), FEWEST_NOISE)
    out[3] = noise * (1.0 + max(0.0, 1.0 - 0.5 * dark / noise))  # half of it is clipped at black


@kernel
def _pull(
    luma: Image,
    light: Array,
    box: Box,
    ground: Array,
    shape: Array,
    u: float,
    v: float,
    out: Array,
) -> None:
    """The window about (u, v): out is the pull (2,) and how it falls as (u, v) moves (4,)."""
    left, top, right, bottom = box[0], box[1], box[2], box[3]
    mid_u, mid_v = 0.5 * (left + right), 0.5 * (top + bottom)
    a, b, c = shape[0], shape[1], shape[2]
    out[:] = 0.0
    for y in range(top, bottom + 1):
        dv = y - v
        level = ground[0] + ground[2] * (y - mid_v)
        for x in range(left, right + 1):
            du = x - u
            q = a * du * du + 2.0 * b * du * dv + c * dv * dv
            if q >= 2.0:
                continue
            q3 = q * q * q / 16.0
            fall = 1.0 - q3 * q
            weight = fall * fall  # (1 − (q/2)⁴)²
            slope = -16.0 * fall * q3  # ∂weight/∂q · 2 … times (a du + b dv)
            grey = light[luma[y, x]] - level - ground[1] * (x - mid_u)
            gu, gv = slope * (a * du + b * dv) * grey, slope * (b * du + c * dv) * grey
            out[0] += weight * grey * du
            out[1] += weight * grey * dv
            out[2] += weight * grey + gu * du
            out[3] += gu * dv
            out[4] += gv * du
            out[5] += weight * grey + gv * dv


@kernel
def _scatter(
    luma: Image, slope_of: Array, box: Box, shape: Array, u: float, v: float, out: Array
) -> None:
    """Sums over the window, out (6,).

    Of (weight × place × slope of light by grey)²: uu, uv, vv; of weight × place²: uu, vv; and of
    clipped pixels.
    """
    a, b, c = shape[0], shape[1], shape[2]
    out[:] = 0.0
    for y in range(box[1], box[3] + 1):
        dv = y - v
        for x in range(box[0], box[2] + 1):
            du = x - u
            q = a * du * du + 2.0 * b * du * dv + c * dv * dv
            if q >= 2.0:
                continue
            fall = 1.0 - q * q * q * q / 16.0
            weight, slope = fall * fall, slope_of[luma[y, x]]
            s = weight * weight * slope * slope
            out[0] += s * du * du
            out[1] += s * du * dv
            out[2] += s * dv * dv
            out[3] += weight * du * du
            out[4] += weight * dv * dv
            if slope == 0.0:
                out[5] += 1.0


@kernel
def _doubt(spot: Array, sums: Array, pull: Array, ground: Array, coded_px: float) -> None:
    """The covariance of a spot: noise, the ground's slope, clipping, codec, smear."""
    det = pull[2] * pull[5] - pull[3] * pull[4]
    p, q, r, s = pull[5] / det, -pull[4] / det, -pull[3] / det, pull[2] / det
    noise = spot[NOISE] ** 2
    dim = min(max(DIM / spot[CONTRAST], 1.0), MOST_DIM)
    alike = MODEL_PX**2 + CLIPPED_PX**2 * sqrt(sums[5]) + (coded_px * dim) ** 2
    slope_u, slope_v = SLOPE_SHARE * ground[1] * sums[3], SLOPE_SHARE * ground[2] * sums[4]
    spot[C_UU] = noise * (p * p * sums[0] + 2.0 * p * q * sums[1] + q * q * sums[2]) + alike
    spot[C_UV] = noise * (p * r * sums[0] + (p * s + q * r) * sums[1] + q * s * sums[2])
    spot[C_VV] = noise * (r * r * sums[0] + 2.0 * r * s * sums[1] + s * s * sums[2]) + alike
    spot[C_UU] += (p * slope_u) ** 2
    spot[C_VV] += (s * slope_v) ** 2
    half, tilt = 0.5 * (spot[UU] - spot[VV]), spot[UV]
    spread = 2.0 * sqrt(half * half + tilt * tilt)  # of the second moments: along minus across
    streak = max(sqrt(12.0 * spread) - ROUND_PX, 0.0)
    # of twice the angle of the streak
    cosine, sine = 2.0 * half / max(spread, 1e-9), 2.0 * tilt / max(spread, 1e-9)
    shape_uu, shape_uv, shape_vv = 0.5 * (1.0 + cosine), 0.5 * sine, 0.5 * (1.0 - cosine)
    own, shared = (OWN_SMEAR * streak) ** 2, (SHARED_SMEAR * streak) ** 2
    spot[C_UU] += own * shape_uu
    spot[C_UV] += own * shape_uv
    spot[C_VV] += own * shape_vv
    spot[S_UU], spot[S_UV], spot[S_VV] = shared * shape_uu, shared * shape_uv, shared * shape_vv


@kernel
def centre(
    luma: Image,
    light: Array,
    slope_of: Array,
    box: Box,
    coded_px: float,
    spot: Array,
    work: Array,
) -> bool:
    """Refine a spot's place, and tell its covariance; False if there is none within reach.

    Args:
        luma: The picture.
        light: (256,) about linear light of each grey level.
        slope_of: (256,) its slope; 0 where it is clipped.
        box: Left, top, right, bottom of its members with `RING` more: inside the picture.
        coded_px: What a codec adds to a bright spot's place.
        spot: (FIELDS,) its place, area, contrast and moments are known, the rest is written.
        work: (256,) or more.
    """
    ground = np.empty(4)
    ground_of(luma, light, box[0], box[1], box[2], box[3], ground, work)
    moments = spot[UU] * spot[VV] - spot[UV] * spot[UV]
    if not moments > 1e-6:
        return False
    shape = np.empty(3)
    shape[0] = spot[VV] / moments / EXTENT
    shape[1] = -spot[UV] / moments / EXTENT
    shape[2] = spot[UU] / moments / EXTENT
    u, v, pull = spot[U], spot[V], np.empty(6)
    det, trace = 0.0, 0.0
    for _ in range(ITERATIONS):
        _pull(luma, light, box, ground, shape, u, v, pull)
        det, trace = pull[2] * pull[5] - pull[3] * pull[4], pull[2] + pull[5]
        if not (trace > 0.0 and det > 0.01 * trace * trace):
            return False
        du = (pull[5] * pull[0] - pull[4] * pull[1]) / det
        dv = (pull[2] * pull[1] - pull[3] * pull[0]) / det
        step = sqrt(du * du + dv * dv)
        if step > 0.7:
            du, dv = 0.7 * du / step, 0.7 * dv / step
        u, v = u + du, v + dv
        if step < CONVERGED_PX:
            break
    if not (u - spot[U]) ** 2 + (v - spot[V]) ** 2 < FARTHEST_PX**2:
        return False
    spot[U], spot[V] = u, v
    spot[NOISE] = ground[3]
    sums = np.empty(6)
    _scatter(luma, slope_of, box, shape, u, v, sums)
    _doubt(spot, sums, pull, ground, coded_px)
    return True
