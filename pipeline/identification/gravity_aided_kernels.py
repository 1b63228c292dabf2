"""Compiled gravity-aided hypotheses: every two spots as every two LEDs, both verticals known.

With a and b two LEDs seen along d and e, R (l_a − l_b) lies in the plane of d and e: a quadratic in
the yaw with two solutions; then both distances follow linearly.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from pipeline.frames import Array
from pipeline.identification.association_kernels import BinnedSpots, is_complete, name_near
from pipeline.identification.initialisation_kernels import (
    BOUNDED,
    LOOKED,
    MAX_RANGE_M,
    MIN_RANGE_M,
    Wanted,
    Work,
    consider,
    is_new,
    spent,
)
from pipeline.so3_kernels import kernel

NARROW = 0.002
"""Between two rays, in tangents: less says nothing of the depth."""


class _Level(NamedTuple):
    """A body stood upright: b in c but for a turn about the vertical."""

    R: Array
    """(3, 3)."""
    up: Array
    """(3,) in c."""
    parts: Array
    """(3, m, 3) of the LEDs: along the vertical, across it, and that turned by 90° about it."""


@kernel
def _parts(leds: Array, R: Array, up: Array) -> Array:
    m = leds.shape[0]
    parts = np.empty((3, m, 3))
    v = np.empty(3)
    for k in range(m):
        along = 0.0
        for i in range(3):
            v[i] = R[i, 0] * leds[k, 0] + R[i, 1] * leds[k, 1] + R[i, 2] * leds[k, 2]
            along += v[i] * up[i]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            parts[0, k, i] = along * up[i]
            parts[1, k, i] = v[i] - along * up[i]
            parts[2, k, i] = up[a] * v[b] - up[b] * v[a]
    return parts


@kernel
def _yaws(normal: Array, parts: Array, a: int, b: int, out: Array) -> bool:
    """Cosine and sine (2, 2) of the two yaws that put the arm from b to a into a plane."""
    x = y = c = 0.0
    for i in range(3):
        c += normal[i] * (parts[0, a, i] - parts[0, b, i])
        x += normal[i] * (parts[1, a, i] - parts[1, b, i])
        y += normal[i] * (parts[2, a, i] - parts[2, b, i])
    size = sqrt(x * x + y * y)
    if size < 1e-12 or abs(c) > size:
        return False
    x, y, c = x / size, y / size, -c / size
    s = sqrt(max(1.0 - c * c, 0.0))
    out[0, 0], out[0, 1] = x * c - y * s, y * c + x * s
    out[1, 0], out[1, 1] = x * c + y * s, y * c - x * s
    return True


@kernel
def _placed(
    d: Array, e: Array, parts: Array, a: int, b: int, yaw: Array, arms: Array, p: Array
) -> bool:
    """p from s d − r e = arm (least squares), then minus the LED's arm; False: not in reach."""
    dd = ee = de = da = ea = 0.0
    for i in range(3):
        arms[0, i] = parts[0, a, i] + yaw[0] * parts[1, a, i] + yaw[1] * parts[2, a, i]
        other = parts[0, b, i] + yaw[0] * parts[1, b, i] + yaw[1] * parts[2, b, i]
        arms[1, i] = arms[0, i] - other
        dd += d[i] * d[i]
        ee += e[i] * e[i]
        de += d[i] * e[i]
        da += d[i] * arms[1, i]
        ea += e[i] * arms[1, i]
    det = dd * ee - de * de
    if det < 1e-12:
        return False
    s, r = (ee * da - de * ea) / det, (de * da - dd * ea) / det
    if s <= 0.0 or r <= 0.0:
        return False
    for i in range(3):
        p[i] = s * d[i] - arms[0, i]
    near_enough: bool = MIN_RANGE_M < p[0] < MAX_RANGE_M
    return near_enough


@kernel
def _attitude(level: _Level, yaw: Array, R: Array) -> None:
    """R = a turn about the vertical times the level attitude."""
    up, L = level.up, level.R
    for j in range(3):
        along = up[0] * L[0, j] + up[1] * L[1, j] + up[2] * L[2, j]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            axial = along * up[i]
            R[i, j] = axial + yaw[0] * (L[i, j] - axial)
            R[i, j] += yaw[1] * (up[a] * L[b, j] - up[b] * L[a, j])


@kernel
def _try_pair(
    rays: Array, level: _Level, reach_m: float, wanted: Wanted, lights: BinnedSpots, work: Work
) -> None:
    """Two rays (2, 3) as every two LEDs."""
    m = wanted.leds.shape[0]
    d, e, normal = rays[0], rays[1], np.empty(3)
    for k in range(3):
        g, h = (k + 1) % 3, (k + 2) % 3
        normal[k] = d[g] * e[h] - d[h] * e[g]
    yaws, arms, p, R = np.empty((2, 2)), np.empty((2, 3)), np.empty(3), np.empty((3, 3))
    names = np.empty(m, dtype=np.int64)
    for a in range(m):
        for b in range(m):
            work.counters[LOOKED] += 1
            if a == b or not _yaws(normal, level.parts, a, b, yaws):
                continue
            for twin in range(2):
                yaw = yaws[twin]
                if not _placed(d, e, level.parts, a, b, yaw, arms, p):
                    continue
                _attitude(level, yaw, R)
                reach = reach_m / p[0]
                if not is_complete(p, R, wanted.leds, m - wanted.least, reach, lights):
                    continue
                if name_near(p, R, wanted.leds, reach, lights, names) < wanted.least:
                    continue
                eighth = int(4.0 + 1.9 * yaw[0]) * 8 + int(4.0 + 1.9 * yaw[1])
                if is_new(names, eighth, work):
                    consider(p, R, names, wanted, lights, work)


@kernel
def upright(
    level_R: Array, reach_m: float, budget: int, wanted: Wanted, lights: BinnedSpots, work: Work
) -> None:
    """Explain spots with the attitude known but for the yaw.

    Args:
        level_R: (3, 3) from b to c, right up to a turn about the vertical.
        reach_m: How far an LED may be, because gravity is not quite known.
        budget: Work, in looks at a hypothesis.
        wanted: The robot; both verticals.
        lights: The spots.
        work: Explanations are added.
    """
    up = wanted.ups[0]
    level = _Level(level_R, up, _parts(wanted.leds, level_R, up))
    tangents, rays = lights.tangents, np.ones((2, 3))
    for j in range(1, tangents.shape[0]):
        for i in range(j):
            if spent(work) > budget:
                work.counters[BOUNDED] = 1
                return
            dy, dz = tangents[i, 0] - tangents[j, 0], tangents[i, 1] - tangents[j, 1]
            if dy * dy + dz * dz > NARROW * NARROW:
                rays[0, 1:], rays[1, 1:] = tangents[i], tangents[j]
                _try_pair(rays, level, reach_m, wanted, lights, work)
