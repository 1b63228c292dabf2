"""Compiled: the bright spots in windows of a picture."""

from __future__ import annotations

from math import ceil

import numpy as np

from pipeline.camera.lens_kernels import OUT_2, VECTOR
from pipeline.frames import Array
from pipeline.jit import numba
from pipeline.signals import Image
from pipeline.so3_kernels import kernel
from pipeline.spots.centroid_kernels import (
    AREA,
    CONTRAST,
    FIELDS,
    RING,
    U,
    V,
    centre,
)
from pipeline.spots.flood_kernels import Pixels, bright, brightest, flood, forget
from pipeline.spots.ground_kernels import Box, border, noise_of, put_ring

WINDOW = 21
"""Half of a window's side [px], at most, when it is asked for."""
LARGEST = 45
"""The same after it has grown about a spot that did not fit."""
SIGMAS, LEAST_GREY = 8.0, 6.0
"""Noises, and grey levels, by which a spot rises above its surround at least."""
DIMMER = 0.25
"""Of the brightest contrast around: dimmer ones are no LEDs beside one, as those are alike."""
SHARES = (0.7, 0.85, 0.95)
"""Of the contrast: what is above belongs to the spot; above a higher one if there is no end to that
one: an arm in the sun is nearly as bright as its LED."""
ENDLESS = -1
"""In place of a count of pixels: they reach the window's border."""
ROUNDS, OF_ONE_WINDOW = 6, 4
"""Peaks looked at, and spots taken, of one window."""
SAME_PX = 1.5
CUT = 2
"""Spots whose light goes on within so many pixels of the picture's border are cut by it."""

WINDOWS = numba.types.Array(numba.int64, 2, "A", readonly=True)
LUMA = numba.types.Array(numba.uint8, 2, "A", readonly=True)
"""Read-only and of any layout: a decoder's rows have gaps, and no picture may compile anew."""


@kernel
def least_contrast(usual: float, noise: float, brightest: float) -> float:
    """Of a spot, in grey levels: the `usual` one, or less where noise and other lights allow."""
    return min(usual, max(SIGMAS * noise, LEAST_GREY, DIMMER * brightest))


@kernel
def _is_new(table: Array, n: int, spot: Array) -> bool:
    for i in range(n):
        if (table[i, U] - spot[U]) ** 2 + (table[i, V] - spot[V]) ** 2 < SAME_PX * SAME_PX:
            return False
    return True


@kernel
def _members(
    luma: Image,
    light: Array,
    box: Box,
    pu: int,
    pv: int,
    ground: float,
    mark: int,
    seen: Image,
    stack: Pixels,
    extent: Box,
) -> tuple[int, float]:
    """Mark a spot about its peak by the lowest share above which it ends inside the window.

    Gives its pixels, 0 as `flood` does, `ENDLESS` if no share parts it; and the light above which
    it had to be parted from what is around it, 0 if it had not.
    """
    peak, area, edge = int(luma[pv, pu]), 0, 0.0
    for share in SHARES:
        rise = (1.0 - share) * (peak - ground)
        if share > SHARES[0]:
            if area == 0 or rise < LEAST_GREY:
                break
            forget(seen, mark, extent)
            edge = light[int(peak - rise)]
        area = flood(luma, box, pu, pv, peak - rise, mark, seen, stack, extent)
        begins = extent[0] >= 1 and extent[1] >= 1
        if begins and extent[2] < box[2] - box[0] and extent[3] < box[3] - box[1]:
            return area, edge
    return ENDLESS, 0.0


@kernel
def _spot_at(
    luma: Image,
    light: Array,
    slope_of: Array,
    box: Box,
    extent: Box,
    mark: int,
    edge: float,
    coded_px: float,
    seen: Image,
    work: Array,
    spot: Array,
) -> bool:
    """Measure the spot whose members are marked; False if the picture's border cuts it."""
    height, width = luma.shape
    ring = np.empty(4, dtype=np.int64)
    ring[0], ring[1] = box[0] + extent[0] - RING, box[1] + extent[1] - RING
    ring[2], ring[3] = box[0] + extent[2] + RING, box[1] + extent[3] + RING
    if ring[0] < CUT - RING or ring[1] < CUT - RING:
        return False
    if ring[2] > width - 1 - CUT + RING or ring[3] > height - 1 - CUT + RING:
        return False
    ring[0], ring[1] = max(0, ring[0]), max(0, ring[1])
    ring[2], ring[3] = min(width - 1, ring[2]), min(height - 1, ring[3])
    return centre(luma, light, slope_of, box, extent, mark, edge, seen, ring, coded_px, spot, work)


@kernel
def _in_window(
    luma: Image,
    light: Array,
    slope_of: Array,
    window: Box,
    limits: Array,
    seen: Image,
    stack: Pixels,
    work: Array,
    table: Array,
    n: int,
    wide: Box,
) -> int:
    """Add the spots of a window (u, v, half its side) to table[:n]; gives their count.

    `wide` (3,): the middle of one that does not fit, and whether there is one.
    """
    height, width = luma.shape
    u0, v0, half = window[0], window[1], window[2]
    box = np.empty(4, dtype=np.int64)
    box[0], box[2] = max(0, u0 - half), min(width - 1, u0 + half)
    box[1], box[3] = max(0, v0 - half), min(height - 1, v0 + half)
    if box[2] - box[0] < 4 or box[3] - box[1] < 4:
        return n
    columns, rows = box[2] - box[0] + 1, box[3] - box[1] + 1
    ground = border(luma, box)
    seen[:rows, :columns] = 0
    spot, extent, taken = np.empty(FIELDS), np.empty(4, dtype=np.int64), 0
    noise = noise_of(work, put_ring(luma, box, work), ground)
    least = least_contrast(limits[0], noise, brightest(luma, box) - ground)
    count = bright(luma, box, ceil(ground + least), stack)
    for mark in range(1, ROUNDS + 1):
        peak, pu, pv = -1, 0, 0
        for k in range(len(stack) - count, len(stack)):
            v, u = box[1] + stack[k, 0], box[0] + stack[k, 1]
            if luma[v, u] > peak and seen[v - box[1], u - box[0]] == 0:
                peak, pu, pv = int(luma[v, u]), u, v
        if peak < 0:
            break
        area, edge = _members(luma, light, box, pu, pv, ground, mark, seen, stack, extent)
        if area == ENDLESS:
            if wide[2] == 0:
                wide[0] = box[0] + (extent[0] + extent[2]) // 2
                wide[1] = box[1] + (extent[1] + extent[3]) // 2
                wide[2] = 1
            continue
        if area == 0:
            continue
        spot[CONTRAST] = peak - ground
        if not _spot_at(
            luma, light, slope_of, box, extent, mark, edge, limits[4], seen, work, spot
        ):
            continue
        if not limits[1] <= spot[AREA] <= limits[2]:
            continue
        if n < len(table) and _is_new(table, n, spot):
            table[n] = spot
            n += 1
        taken += 1
        if taken == OF_ONE_WINDOW:
            break
    return n


@numba.njit((LUMA, VECTOR, VECTOR, WINDOWS, VECTOR, OUT_2), cache=True, error_model="numpy")
def measure(
    luma: Image, light: Array, slope_of: Array, windows: Box, limits: Array, table: Array
) -> int:
    """Measure the spots in square windows; gives their count.

    A window grows once about a spot that does not fit; what still reaches its border is none.

    Args:
        luma: The picture.
        light: (256,) about linear light of each grey level.
        slope_of: (256,) its slope; 0 where it is clipped.
        windows: (w, 3) middle and half the side [px].
        limits: (5,) contrast in grey levels that is enough in any noise, least and most pixels,
            most windows that grow, and what a codec adds to a place [px].
        table: (n, FIELDS) written, until it is full.
    """
    seen = np.empty((2 * LARGEST + 1, 2 * LARGEST + 1), dtype=np.uint8)
    stack = np.empty((2 * (2 * LARGEST + 1) ** 2, 2), dtype=np.int16)
    work = np.empty(8 * (LARGEST + RING))
    wide, larger = np.zeros(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    n, grown = 0, 0.0
    for w in range(len(windows)):
        window = windows[w]
        if not (0 < window[2] <= LARGEST):
            continue
        wide[2] = 0
        n = _in_window(luma, light, slope_of, window, limits, seen, stack, work, table, n, wide)
        if wide[2] == 1 and window[2] < LARGEST and grown < limits[3]:
            grown += 1.0
            larger[0], larger[1], larger[2] = wide[0], wide[1], LARGEST
            n = _in_window(luma, light, slope_of, larger, limits, seen, stack, work, table, n, wide)
    return n
