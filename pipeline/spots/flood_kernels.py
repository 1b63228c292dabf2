"""Compiled: the pixels of a window that belong together."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel
from pipeline.spots.centroid_kernels import BRIGHTNESS, UU, UV, VV, Box, U, V

Pixels = npt.NDArray[np.int16]


@kernel
def border(luma: Image, box: Box) -> float:
    """Median of the window's border."""
    counts = np.zeros(256, dtype=np.int32)
    for u in range(box[0], box[2] + 1):
        counts[luma[box[1], u]] += 1
        counts[luma[box[3], u]] += 1
    for v in range(box[1] + 1, box[3]):
        counts[luma[v, box[0]]] += 1
        counts[luma[v, box[2]]] += 1
    half, below, grey = (box[2] - box[0] + box[3] - box[1]), 0, 0
    while below + counts[grey] < half:
        below += counts[grey]
        grey += 1
    return float(grey)


@kernel
def bright(luma: Image, box: Box, least: int, stack: Pixels) -> int:
    """Rows and columns of a window's pixels from `least` on: how many, at the end of `stack`."""
    n, end = 0, len(stack) - 1
    for v in range(box[1], box[3] + 1):
        for u in range(box[0], box[2] + 1):
            if luma[v, u] >= least:
                stack[end - n, 0], stack[end - n, 1] = v - box[1], u - box[0]
                n += 1
    return n


@kernel
def flood(
    luma: Image,
    box: Box,
    pu: int,
    pv: int,
    threshold: float,
    mark: int,
    seen: Image,
    stack: Pixels,
    extent: Box,
) -> int:
    """Mark the members about (pu, pv) in `seen`; `extent` is their box; gives their count.

    0: they touch members of an earlier spot, whose skirt this then is.
    """
    left, top = box[0], box[1]
    columns, rows = box[2] - left + 1, box[3] - top + 1
    seen[pv - top, pu - left] = mark
    stack[0, 0], stack[0, 1] = pv - top, pu - left
    n, area, is_skirt = 1, 0, False
    low_r, low_c, high_r, high_c = rows, columns, -1, -1
    while n > 0:
        n -= 1
        r, c = stack[n, 0], stack[n, 1]
        area += 1
        low_r, low_c = min(low_r, r), min(low_c, c)
        high_r, high_c = max(high_r, r), max(high_c, c)
        for rr in range(max(0, r - 1), min(rows, r + 2)):
            for cc in range(max(0, c - 1), min(columns, c + 2)):
                if seen[rr, cc] == 0:
                    if luma[top + rr, left + cc] > threshold:
                        seen[rr, cc] = mark
                        stack[n, 0], stack[n, 1] = rr, cc
                        n += 1
                elif seen[rr, cc] != mark:
                    is_skirt = True
    extent[0], extent[1], extent[2], extent[3] = low_c, low_r, high_c, high_r
    return 0 if is_skirt else area


@kernel
def moments(
    luma: Image, light: Array, box: Box, extent: Box, mark: int, seen: Image, spot: Array
) -> None:
    """Centroid, sum and second moments of the members grown by one pixel."""
    left, top = box[0], box[1]
    floor = np.inf
    for r in range(extent[1] - 1, extent[3] + 2):
        for c in range(extent[0] - 1, extent[2] + 2):
            floor = min(floor, light[luma[top + r, left + c]])
    total = su = sv = suu = suv = svv = 0.0
    for r in range(extent[1] - 1, extent[3] + 2):
        for c in range(extent[0] - 1, extent[2] + 2):
            is_near = False
            for rr in range(max(extent[1], r - 1), min(extent[3], r + 1) + 1):
                for cc in range(max(extent[0], c - 1), min(extent[2], c + 1) + 1):
                    is_near = is_near or seen[rr, cc] == mark
            if not is_near:
                continue
            w = light[luma[top + r, left + c]] - floor
            u, v = float(c), float(r)
            total += w
            su += w * u
            sv += w * v
            suu += w * u * u
            suv += w * u * v
            svv += w * v * v
    u, v = su / total, sv / total
    spot[U], spot[V], spot[BRIGHTNESS] = left + u, top + v, total
    spot[UU], spot[UV], spot[VV] = suu / total - u * u, suv / total - u * v, svv / total - v * v
