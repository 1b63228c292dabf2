"""Compiled: how each LED is exposed, from the pixels around it."""

from __future__ import annotations

from typing import Final

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel

HALF_PX: Final = 12
"""Half a window."""
CONTRAST, CLIPPED, UU, UV, VV = range(5)
"""Columns: grey levels above the surround, white pixels, second moments [px²]."""


@kernel
def put_exposures(luma: Image, pixels: Array, white: float, out: Array) -> None:
    """Fill `out` (n, 5) for LEDs at `pixels` (n, 2); contrast 0 where the window leaves."""
    height, width = luma.shape
    for k in range(len(pixels)):
        out[k] = 0.0
        u, v = round(pixels[k, 0]), round(pixels[k, 1])
        left, top, right, bottom = u - HALF_PX, v - HALF_PX, u + HALF_PX, v + HALF_PX
        if left < 0 or top < 0 or right >= width or bottom >= height:
            continue
        around, peak = 0.0, 0.0
        for i in range(2 * HALF_PX):
            around += float(luma[top, left + i]) + float(luma[bottom, right - i])
            around += float(luma[bottom - i, left]) + float(luma[top + i, right])
        around /= 8.0 * HALF_PX
        for row in range(v - 1, v + 2):
            for column in range(u - 1, u + 2):
                peak = max(peak, float(luma[row, column]))
        if peak > around:
            put_moments(luma, left, top, around, peak, white, out[k])


@kernel
def put_moments(
    luma: Image, left: int, top: int, around: float, peak: float, white: float, out: Array
) -> None:
    """Fill one row of `put_exposures`."""
    least = around + 0.4 * (peak - around)
    total, su, sv, uu, uv, vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    clipped = 0
    for i in range(2 * HALF_PX + 1):
        for j in range(2 * HALF_PX + 1):
            level = float(luma[top + i, left + j])
            if level < least:
                continue
            weight, x, y = level - around, float(j), float(i)
            total += weight
            su += weight * x
            sv += weight * y
            uu += weight * x * x
            uv += weight * x * y
            vv += weight * y * y
            if level >= white:
                clipped += 1
    mean_u, mean_v = su / total, sv / total
    out[CONTRAST], out[CLIPPED] = peak - around, clipped
    out[UU] = uu / total - mean_u * mean_u
    out[UV] = uv / total - mean_u * mean_v
    out[VV] = vv / total - mean_v * mean_v
