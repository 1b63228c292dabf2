"""Compiled: which wrong naming of a view's spots fits best, and what else a right one fits."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import numpy.typing as npt

from hardware.led_layout.fit_kernels import (
    FREE,
    SCRATCH,
    TILT,
    TURN,
    beyond,
    kernel,
    refine,
)
from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array
from pipeline.identification.p3p_kernels import p3p, put_triad
from pipeline.so3_kernels import multiply, put_exp

YAWS = 8
"""From how many yaws a fit starts when only the tilt is known."""
Indices = npt.NDArray[np.int64]
ALL_SCRATCH = 226
"""Numbers: the first `SCRATCH` are the fit's."""
OTHER_RAD = 0.09
"""Two poses that differ by more than 5° are two."""


@kernel
def _put_triple(px: Array, triple: Indices) -> None:
    """The three spots that span the largest triangle."""
    best = -1.0
    for i in range(px.shape[0]):
        for j in range(i + 1, px.shape[0]):
            for k in range(j + 1, px.shape[0]):
                u, v = px[j, 0] - px[i, 0], px[j, 1] - px[i, 1]
                area = abs(u * (px[k, 1] - px[i, 1]) - v * (px[k, 0] - px[i, 0]))
                if area > best:
                    best, triple[0], triple[1], triple[2] = area, i, j, k


@kernel
def _put_place(leds: Array, px: Array, f: float, R: Array, p: Array) -> bool:
    """Position (3,) that fits best linearly with the attitude given; whether it is in front."""
    h, g = np.zeros((3, 3)), np.zeros(3)
    row = np.zeros(3)
    for k in range(leds.shape[0]):
        for side in range(2):
            row[:] = 0.0
            row[0], row[1 + side] = px[k, side] / f, 1.0
            value = 0.0
            for j in range(3):
                value -= (row[0] * R[0, j] + R[1 + side, j]) * leds[k, j]
            for i in range(3):
                g[i] += row[i] * value
                for j in range(3):
                    h[i, j] += row[i] * row[j]
    # rows of y and z meet only in x: two eliminations
    x = h[0, 0] - h[0, 1] ** 2 / h[1, 1] - h[0, 2] ** 2 / h[2, 2]
    if not x > 1e-12:
        return False
    p[0] = (g[0] - h[0, 1] * g[1] / h[1, 1] - h[0, 2] * g[2] / h[2, 2]) / x
    p[1] = (g[1] - h[0, 1] * p[0]) / h[1, 1]
    p[2] = (g[2] - h[0, 2] * p[0]) / h[2, 2]
    return bool(p[0] > NEAREST_M)


@kernel
def _turn_by(R_true: Array, yaw: float, turn: Array, R: Array) -> None:
    """R = R_true turned about the body's z."""
    put_exp(0.0, 0.0, yaw, turn)
    multiply(R_true, turn, R)


@kernel
def _misfit(leds: Array, px: Array, f: float, R: Array, p: Array) -> float:
    """Sum of squares [px²] without the perspective that each depth of its own would make."""
    total = 0.0
    for k in range(leds.shape[0]):
        for side in range(2):
            off = px[k, side] / f * p[0] + p[1 + side]
            for j in range(3):
                off += (px[k, side] / f * R[0, j] + R[1 + side, j]) * leds[k, j]
            total += (f * off / p[0]) ** 2
    return total


@kernel
def _pull(R: Array, R_true: Array, known: int, limit: float) -> bool:
    """Turns an attitude to the border of what is known; whether it was outside."""
    gradient, turn, new = np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    pulled = False
    for _ in range(2):  # the gradient is a unit axis: once is exact but at 180°
        excess = beyond(R, R_true, known, limit, gradient)
        if excess <= 1e-6:
            break
        pulled = True
        put_exp(-excess * gradient[0], -excess * gradient[1], -excess * gradient[2], turn)
        multiply(R, turn, new)
        R[:] = new
    return pulled


@kernel
def _put_starts(
    leds: Array, px: Array, f: float, triple: Indices, work: Array, Rs: Array, ps: Array
) -> int:
    """Poses that three of the spots allow, or nearly: where to start from; how many."""
    points = work[SCRATCH : SCRATCH + 9].reshape(3, 3)
    rays = work[SCRATCH + 9 : SCRATCH + 18].reshape(3, 3)
    for k in range(3):
        t = triple[k]
        size = sqrt(f * f + px[t, 0] ** 2 + px[t, 1] ** 2)
        rays[k, 0], rays[k, 1], rays[k, 2] = f / size, -px[t, 0] / size, -px[t, 1] / size
        points[k] = leds[t]
    triad = work[SCRATCH + 18 : SCRATCH + 27].reshape(3, 3)
    put_triad(points[0], points[1], points[2], triad)
    count = 0
    for k in range(p3p(rays, points, triad, np.inf, ps, Rs)):
        if count > 0 and (ps[k] == ps[count - 1]).all():  # the real part of a pair, twice
            continue
        ps[count], Rs[count] = ps[k], Rs[k]
        count += 1
    return count


@kernel
def _fit_named(
    leds: Array,
    px: Array,
    f: float,
    R_true: Array,
    known: int,
    limit: float,
    enough: float,
    work: Array,
    R: Array,
    p: Array,
    Rs: Array,
    ps: Array,
    triple: Indices,
) -> float:
    """Least sum of squares [px²] of one naming over the starts that geometry gives."""
    best = enough
    for k in range(_put_starts(leds, px, f, triple, work, Rs, ps)):
        R[:], p[:] = Rs[k], ps[k]
        if known != FREE and _pull(R, R_true, known, limit) and not _put_place(leds, px, f, R, p):
            continue
        best = min(best, refine(leds, px, f, R, p, R_true, known, limit, best, work))
    if known == FREE:
        return best
    yaws, costs = YAWS if known == TILT else 1, work[218 : 218 + YAWS]
    for k in range(yaws):
        _turn_by(R_true, 2.0 * pi * k / yaws, Rs[0], R)
        costs[k] = _misfit(leds, px, f, R, p) if _put_place(leds, px, f, R, p) else np.inf
    for k in range(yaws):  # only from the valleys of that circle
        if costs[k] < np.inf and costs[k] <= min(costs[(k - 1) % yaws], costs[(k + 1) % yaws]):
            _turn_by(R_true, 2.0 * pi * k / yaws, Rs[0], R)
            _put_place(leds, px, f, R, p)
            best = min(best, refine(leds, px, f, R, p, R_true, known, limit, best, work))
    return best


@kernel
def smallest_wrong(
    leds: Array,
    px: Array,
    f: float,
    R_true: Array,
    known: int,
    limit: float,
    spots: Indices,
    names: Indices,
    above: float,
) -> tuple[float, int]:
    """Least RMS [px] of any wrong naming, and which; (`above`, −1) if none is below it.

    Args:
        leds: (n, 3) in b [m].
        px: (n, 2) where each is seen: tangents (right, down) times the focal length.
        f: Focal length [px].
        R_true: (3, 3) attitude R_cb.
        known: `FREE`, `TILT` or `TURN`: what a naming knows of it.
        limit: To how much [rad].
        spots: (h, m) integers: the spots that are named.
        names: (h, m) integers: the LED that each is taken for.
        above: Only what is below this counts [px].
    """
    m = spots.shape[1]
    work, triple = np.zeros(ALL_SCRATCH), np.zeros(3, np.int64)
    R, p, Rs, ps = np.zeros((3, 3)), np.zeros(3), np.zeros((4, 3, 3)), np.zeros((4, 3))
    some_px, some_leds = np.zeros((m, 2)), np.zeros((m, 3))
    best, which = m * above * above, -1
    for h in range(spots.shape[0]):
        for k in range(m):
            some_px[k], some_leds[k] = px[spots[h, k]], leds[names[h, k]]
        if h == 0 or (spots[h] != spots[h - 1]).any():
            _put_triple(some_px, triple)
        cost = _fit_named(
            some_leds, some_px, f, R_true, known, limit, best, work, R, p, Rs, ps, triple
        )
        if cost < best:
            best, which = cost, h
    return sqrt(best / m), which


@kernel
def other_pose(leds: Array, px: Array, f: float, R_true: Array) -> tuple[float, float]:
    """Least RMS [px] of another pose of rightly named spots, and how far it is turned [rad].

    (inf, 0) when there is no second minimum.
    """
    m = leds.shape[0]
    work, triple = np.zeros(ALL_SCRATCH), np.zeros(3, np.int64)
    R, p, Rs, ps = np.zeros((3, 3)), np.zeros(3), np.zeros((4, 3, 3)), np.zeros((4, 3))
    best, turned, gradient = np.inf, 0.0, np.zeros(3)
    for i in range(m):
        for j in range(i + 1, m):
            for o in range(j + 1, m):
                triple[0], triple[1], triple[2] = i, j, o
                for k in range(_put_starts(leds, px, f, triple, work, Rs, ps)):
                    R[:], p[:] = Rs[k], ps[k]
                    cost = refine(leds, px, f, R, p, R_true, FREE, 0.0, 1e12, work)
                    angle = beyond(R, R_true, TURN, 0.0, gradient)
                    if angle > OTHER_RAD and cost < best:
                        best, turned = cost, angle
    return sqrt(best / m), turned
