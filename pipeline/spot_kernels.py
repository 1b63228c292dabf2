"""Compiled: one bright spot measured in its window."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.frames import Array
from pipeline.signals import Image

WINDOW = 21
"""Half of the largest window's side [px]."""
SHARE = 0.4
"""Of the contrast: what is above belongs to the spot."""
FIELDS = 9
"""u, v, brightness, area, contrast, the second moments uu, uv, vv, and the surround's noise."""


_LUMA = numba.types.Array(numba.uint8, 2, "A", readonly=True)
"""Read-only and of any layout: a decoder's rows have gaps, and no picture may compile anew."""


@numba.njit(cache=True)
def _surround(luma: Image, left: int, right: int, top: int, bottom: int) -> tuple[float, float]:
    """Median of the window's border, and how far its pixels are from it on average."""
    border = np.empty(2 * (right - left + 1 + bottom - top + 1), dtype=np.float64)
    n = 0
    for u in range(left, right + 1):
        border[n], border[n + 1] = luma[top, u], luma[bottom, u]
        n += 2
    for v in range(top, bottom + 1):
        border[n], border[n + 1] = luma[v, left], luma[v, right]
        n += 2
    median = float(np.median(border[:n]))
    return median, float(np.mean(np.abs(border[:n] - median)))


@numba.njit(cache=True)
def _moments(
    luma: Image, member: Image, left: int, top: int, background: float, out: Array
) -> None:
    """Intensity-weighted centroid and moments over the spot grown by one pixel."""
    rows, columns = member.shape
    total = su = sv = suu = suv = svv = 0.0
    for r in range(1, rows - 1):
        for c in range(1, columns - 1):
            near = False
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    near = near or member[r + dr, c + dc] == 1
            if not near:
                continue
            w = max(0.0, luma[top + r, left + c] - background)
            u, v = float(left + c), float(top + r)
            total += w
            su += w * u
            sv += w * v
            suu += w * u * u
            suv += w * u * v
            svv += w * v * v
    u, v = su / total, sv / total
    out[0], out[1], out[2] = u, v, total
    out[5] = suu / total - u * u
    out[6] = suv / total - u * v
    out[7] = svv / total - v * v


@numba.njit((_LUMA, numba.int64, numba.int64, numba.int64, numba.float64[::1]), cache=True)
def measure(luma: Image, u0: int, v0: int, half: int, out: Array) -> bool:
    """Measure the spot of the window's brightest pixel; False if there is none.

    The background is the median of the window's border; a spot that reaches the border is none.
    """
    height, width = luma.shape
    left, right = max(0, u0 - half), min(width - 1, u0 + half)
    top, bottom = max(0, v0 - half), min(height - 1, v0 + half)
    if right - left < 4 or bottom - top < 4:
        return False
    background, noise = _surround(luma, left, right, top, bottom)
    peak, pu, pv = -1, u0, v0
    for v in range(top, bottom + 1):
        for u in range(left, right + 1):
            if luma[v, u] > peak:
                peak, pu, pv = int(luma[v, u]), u, v
    contrast = peak - background
    if contrast <= 0.0:
        return False
    threshold = background + SHARE * contrast
    columns, rows = right - left + 1, bottom - top + 1
    member = np.zeros((rows, columns), dtype=np.uint8)
    stack = np.empty((rows * columns, 2), dtype=np.int32)
    stack[0, 0], stack[0, 1] = pv - top, pu - left
    member[pv - top, pu - left] = 1
    count, area = 1, 0
    while count > 0:
        count -= 1
        r, c = stack[count, 0], stack[count, 1]
        area += 1
        if r == 0 or c == 0 or r == rows - 1 or c == columns - 1:
            return False
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                rr, cc = r + dr, c + dc
                if member[rr, cc] == 0 and luma[top + rr, left + cc] > threshold:
                    member[rr, cc] = 1
                    stack[count, 0], stack[count, 1] = rr, cc
                    count += 1
    _moments(luma, member, left, top, background, out)
    out[3], out[4], out[8] = area, contrast, noise
    return True
