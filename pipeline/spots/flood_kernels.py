"""Compiled: the pixels of a window that belong together."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.signals import Image
from pipeline.so3_kernels import kernel
from pipeline.spots.ground_kernels import Box

Pixels = npt.NDArray[np.int16]


@kernel
def brightest(luma: Image, box: Box) -> int:
    """Highest grey level of a window."""
    highest = 0
    for v in range(box[1], box[3] + 1):
        for u in range(box[0], box[2] + 1):
            highest = max(highest, luma[v, u])
    return highest


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
def forget(seen: Image, mark: int, extent: Box) -> None:
    """Take back the members of a flood, of which `extent` is the box."""
    for r in range(extent[1], extent[3] + 1):
        for c in range(extent[0], extent[2] + 1):
            if seen[r, c] == mark:
                seen[r, c] = 0


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
