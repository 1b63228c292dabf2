"""Compiled: every pair of spots as every pair of LEDs, with gravity known."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.frames import Array

NEAREST_M, FARTHEST_M = 0.3, 12.0

_VECTOR = numba.types.Array(numba.float64, 1, "C", readonly=True)
_TABLE = numba.types.Array(numba.float64, 2, "C", readonly=True)


@numba.njit(cache=True)
def _turned(v: Array, up: Array, yaw: float) -> Array:
    axial = (v @ up) * up
    turned: Array = axial + np.cos(yaw) * (v - axial) + np.sin(yaw) * np.cross(up, v)
    return turned


@numba.njit(cache=True)
def _place(d: Array, e: Array, arm: Array, led: Array, up: Array, yaw: float) -> Array:
    """Position of b from s d − r e = arm (least squares), then minus the LED's place in b."""
    dd, ee, de = d @ d, e @ e, d @ e
    det = dd * ee - de * de
    if det < 1e-12:
        return np.zeros(3)
    s = (ee * (d @ arm) - de * (e @ arm)) / det
    r = (de * (d @ arm) - dd * (e @ arm)) / det
    if s <= 0.0 or r <= 0.0:
        return np.zeros(3)
    return s * d - _turned(led, up, yaw)


@numba.njit(cache=True)
def _score(
    rays: Array, levelled: Array, up: Array, yaw: float, place: Array, reach_m: float
) -> float:
    """LEDs near a spot, and a little for nearness."""
    score, reach = 0.0, reach_m / place[0]
    for k in range(levelled.shape[0]):
        q = place + _turned(levelled[k], up, yaw)
        if q[0] < 0.1:
            return 0.0
        best = reach * reach
        for s in range(rays.shape[0]):
            du, dv = q[1] / q[0] - rays[s, 1], q[2] / q[0] - rays[s, 2]
            best = min(best, du * du + dv * dv)
        if best < reach * reach:
            score += 1.0 + 0.1 * (1.0 - np.sqrt(best) / reach)
    return score


@numba.njit((_TABLE, _TABLE, _TABLE, _VECTOR, numba.float64), cache=True)
def pair_hypotheses(
    rays: Array, leds_in_b: Array, level: Array, up_in_c: Array, reach_m: float
) -> tuple[Array, Array, Array]:
    """Poses from pairs: (scores (h,), p_bc_in_c (h, 3), yaw (h,)); R_cb = Exp(yaw up) level.

    With a and b two LEDs seen along d and e, R (l_a − l_b) lies in the plane of d and e: a
    quadratic in the yaw with two solutions; then both distances follow linearly. The score is how
    many LEDs come to lie within `reach_m` of the ray of a spot.
    """
    n, m = rays.shape[0], leds_in_b.shape[0]
    most = n * (n - 1) * m * (m - 1)
    scores, places, yaws = np.zeros(most), np.zeros((most, 3)), np.zeros(most)
    count = 0
    levelled = leds_in_b @ level.T
    along = levelled @ up_in_c
    for i in range(n):
        for j in range(i + 1, n):
            normal = np.cross(rays[i], rays[j])
            for a in range(m):
                for b in range(m):
                    if a == b:
                        continue
                    arm = levelled[a] - levelled[b]
                    axial = (along[a] - along[b]) * up_in_c
                    flat = arm - axial
                    side = np.cross(up_in_c, arm)
                    x, y, c = normal @ flat, normal @ side, normal @ axial
                    size = np.sqrt(x * x + y * y)
                    if size < 1e-12 or abs(c) > size:
                        continue
                    middle, spread = np.arctan2(y, x), np.arccos(-c / size)
                    for sign in (-1.0, 1.0):
                        yaw = middle + sign * spread
                        turned = axial + np.cos(yaw) * flat + np.sin(yaw) * side
                        place = _place(rays[i], rays[j], turned, levelled[a], up_in_c, yaw)
                        if place[0] < NEAREST_M or place[0] > FARTHEST_M:
                            continue
                        scores[count] = _score(rays, levelled, up_in_c, yaw, place, reach_m)
                        places[count] = place
                        yaws[count] = yaw
                        count += 1
    return scores[:count], places[:count], yaws[:count]
