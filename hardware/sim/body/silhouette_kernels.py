"""Compiled: how much of each pixel a rod or a disc covers, seen through a point spread."""

from __future__ import annotations

from math import ceil, erf, exp, floor, pi, sqrt

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.so3_kernels import kernel

Plane = npt.NDArray[np.float32]
"""(height, width) of a box of the picture."""
EDGE = 3.2
"""Standard deviations of the point spread beyond which an edge is over."""
ROOT_HALF, ROOT_2_PI = sqrt(0.5), sqrt(2.0 * pi)
PLACE = 2  # coordinates


@kernel
def _inside(depth: float, blur_px: float) -> float:
    """Share of the point spread on the inner side of an edge that is `depth` [px] away."""
    x = depth / blur_px
    return 1.0 if x > EDGE else 0.0 if x < -EDGE else 0.5 + 0.5 * erf(ROOT_HALF * x)


@kernel
def _thinned(half2: float, blur_px: float) -> float:
    """How much less a strip of half a width (squared) covers than its edges say by themselves."""
    z = sqrt(half2) / blur_px
    return z / (z * (0.5 + 0.5 * erf(ROOT_HALF * z)) + exp(-0.5 * z * z) / ROOT_2_PI)


@kernel
def _move(ways: Array, row: float, row_s: float, time: float, at: Array) -> None:
    """Places (n, 2) of points with `ways` (n, 6) when `row` is exposed, `time` [s] off that."""
    for i in range(len(ways)):
        t = (row - ways[i, 1]) * row_s + time
        for k in range(PLACE):
            at[i, k] = ways[i, k] + t * (ways[i, 2 + k] + 0.5 * t * ways[i, 4 + k])


@kernel
def cover_rod(
    left: int,
    top: int,
    ways: Array,
    half_px: Array,
    row_s: float,
    times: Array,
    blur_px: float,
    shade: float,
    cover: Plane,
    tone: Plane,
) -> None:
    """What a rod with round ends covers of a box, and how bright that is by the rod's middle.

    Args:
        left: Column of the box's corner.
        top: Its row.
        ways: (2, 6) of its ends: place, velocity, acceleration when the place's row is exposed.
        half_px: (2,) half its width there.
        row_s: How much later each row is exposed than the one above it [s].
        times: (n,) parts of the exposure, from its middle [s].
        blur_px: Standard deviation of the point spread.
        shade: How much brighter its one side is.
        cover: Added to, 0 to 1.
        tone: Added to: cover times brightness.
    """
    height, width = cover.shape
    reach, share = max(half_px[0], half_px[1]) + EDGE * blur_px, 1.0 / len(times)
    at = np.empty((2, PLACE))
    for r in range(height):
        for time in times:
            _move(ways, top + r, row_s, time, at)
            du, dv = at[1, 0] - at[0, 0], at[1, 1] - at[0, 1]
            y = top + r - at[0, 1]
            if y < min(0.0, dv) - reach or y > max(0.0, dv) + reach:
                continue
            length2 = max(du * du + dv * dv, 1e-9)
            length = sqrt(length2)
            low, high = min(0.0, du) - reach, max(0.0, du) + reach
            if abs(dv) > 1e-6:
                middle, wide = y * du / dv, reach * length / abs(dv)
                low, high = max(low, middle - wide), min(high, middle + wide)
            first, last = ceil(at[0, 0] + low) - left, floor(at[0, 0] + high) - left
            for c in range(max(0, first), min(width, last + 1)):
                x = left + c - at[0, 0]
                s = min(max((x * du + y * dv) / length2, 0.0), 1.0)
                off = sqrt((x - s * du) ** 2 + (y - s * dv) ** 2)
                half = half_px[0] + s * (half_px[1] - half_px[0])
                part = _inside(half - off, blur_px) + _inside(half + off, blur_px) - 1.0
                side = min(max((x * dv - y * du) / (length * half), -1.0), 1.0)
                cover[r, c] += share * part
                tone[r, c] += share * part * (1.0 + shade * side)


@kernel
def cover_disc(
    left: int,
    top: int,
    ways: Array,
    thick_px: float,
    row_s: float,
    times: Array,
    blur_px: float,
    cover: Plane,
) -> None:
    """What a disc covers of a box, its `ways` (3, 6) those of its middle and of two of its rim."""
    height, width = cover.shape
    share, at = 1.0 / len(times), np.empty((3, PLACE))
    for r in range(height):
        for time in times:
            _move(ways, top + r, row_s, time, at)
            au, av, bu, bv = (
                at[1, 0] - at[0, 0],
                at[1, 1] - at[0, 1],
                at[2, 0] - at[0, 0],
                at[2, 1] - at[0, 1],
            )
            # its rim: x with xᵀ C⁻¹ x = 1
            uu = au * au + bu * bu + thick_px * thick_px
            uv = au * av + bu * bv
            vv = av * av + bv * bv + thick_px * thick_px
            det, wide = uu * vv - uv * uv, sqrt(uu) + EDGE * blur_px
            half2 = max(0.5 * (uu + vv) - sqrt(0.25 * (uu - vv) ** 2 + uv * uv), 0.0)
            thin = _thinned(half2, blur_px)
            y = top + r - at[0, 1]
            if abs(y) > sqrt(vv) + EDGE * blur_px:
                continue
            first, last = ceil(at[0, 0] - wide) - left, floor(at[0, 0] + wide) - left
            for c in range(max(0, first), min(width, last + 1)):
                x = left + c - at[0, 0]
                gu, gv = (vv * x - uv * y) / det, (uu * y - uv * x) / det
                rho = sqrt(max(x * gu + y * gv, 1e-12))
                steep = max(sqrt(gu * gu + gv * gv) / rho, 1.0 / wide)
                depth = (1.0 - rho) / steep
                if rho < 1.0:
                    depth = min(depth, sqrt(half2 * (1.0 - rho * rho)))
                cover[r, c] += share * thin * _inside(depth, blur_px)


@kernel
def lay(
    light: Plane, left: int, top: int, cover: Plane, tone: Plane, opacity: float, bright: float
) -> None:
    """Put a part before the light of a picture."""
    height, width = cover.shape
    for r in range(height):
        for c in range(width):
            if cover[r, c] > 0.0:
                behind = light[top + r, left + c] * (1.0 - opacity * cover[r, c])
                light[top + r, left + c] = behind + opacity * bright * tone[r, c]


@kernel
def shut_out(
    light: Plane, left: int, top: int, cover: Plane, at_left: int, at_top: int, opacity: float
) -> None:
    """Take what a part at (`at_left`, `at_top`) covers from a light at (`left`, `top`)."""
    rows, columns = light.shape
    height, width = cover.shape
    for r in range(max(0, at_top - top), min(rows, at_top + height - top)):
        for c in range(max(0, at_left - left), min(columns, at_left + width - left)):
            light[r, c] *= 1.0 - opacity * cover[r + top - at_top, c + left - at_left]
