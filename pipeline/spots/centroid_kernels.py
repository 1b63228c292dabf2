"""Compiled: where a spot of light is to a hundredth of a pixel, and how sure that is.

A centroid in about linear light of what rises above a share of the spot's contrast, over the ground
that each pixel would show without it: behind an LED there is an arm on one side and a room on the
other, and what the ring around it shows of both goes on underneath. What stays hidden there hardly
moves the brighter part: the less even the ground, the higher the share; no pixel comes or goes all
at once. The scatter follows from that of each pixel and from the ground's relief.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel
from pipeline.spots.ground_kernels import (
    ARMS,
    LEVEL,
    Box,
    arms_of,
    border,
    ground_at,
    noise_of,
    put_ring,
    relief_of,
)

U, V, BRIGHTNESS, AREA, CONTRAST, UU, UV, VV, NOISE = range(9)
C_UU, C_UV, C_VV, S_UU, S_UV, S_VV = range(9, 15)
FIELDS = 15
"""A spot's row: place, sum above the ground, pixels, contrast in grey levels, second moments, noise
in grey levels, the covariance of the place as far as it is this spot's own, and what uneven motion
during the exposure adds, which all spots share."""
RING = 3
"""Pixels between a spot's members and the ring that tells its ground."""
GROWN = 2
"""Pixels beyond its members that may rise above the share, too."""
MOST_ABOVE, BY_RELIEF = 0.35, 9.0
"""Share of a spot's contrast in light above which a pixel has weight, by as much as it is above: at
most, and how many times the ground's RMS."""
SIZE_SHARE = 0.13
"""Share of a spot's contrast in light above which a pixel is one of its area: 0.4 of it in grey."""
MOST_OFF = 0.6
"""Share of the contrast by which a ring's pixel counts at most: beyond, it is another light."""
MERGED = 0.2
"""Of a spot's radius, times the share of its light that an arm has which could hardly be parted
from it: clipped, both are one white, which reaches farther on the arm's side than on the other."""
LEAST_SURE_PX = 1.5
"""Of a place, its standard deviation: the top of a wide glow is no spot."""
DARKEST = 3
"""Grey levels above black: below, a gamma curve's slope says too little of noise."""
MODEL_PX, EDGE_PX = 0.006, 0.0025
"""What tone curve, lens and rounding leave; and what they do to an edge, over the share of light
that it leaves to the pixel beside, which alone tells where in a pixel an edge is. That is less by
the fourth root of the area: by the root of the edge's length."""
STEEPEST = 0.97
"""Share of the light that one step takes: more cannot be told from rounding."""
RELIEF_SHARE = 0.5
"""Of what a ground as uneven as the ring displaces at most: its parts lie on many sides."""
DIM, MOST_DIM = 80.0, 4.0
"""Grey levels; with less contrast a codec's steps matter more."""
ROUND_PX, OWN_MOTION_BLUR, SHARED_MOTION_BLUR = 1.0, 0.001, 0.005
"""A streak longer than a round spot seems moved while exposed, and not evenly: unsure along it, by
these shares of its length."""

WEIGHT, SU, SV, SUU, SUV, SVV, N_UU, N_UV, N_VV, D_U, D_V, STEP, COUNT = range(13)
"""Sums over a spot's pixels: weight, weight × place, weight × place²; (slope × place)² and |place|
of what is not clipped; the largest step of weight between neighbours, and how many they are."""
SUMS = 13  # numbers of those


@kernel
def is_near(seen: Image, mark: int, row: int, column: int, extent: Box) -> bool:
    """Whether it is a spot's member, or one is within reach."""
    inside = extent[0] <= column <= extent[2] and extent[1] <= row <= extent[3]
    if inside and seen[row, column] == mark:
        return True
    for r in range(max(extent[1], row - GROWN), min(extent[3], row + GROWN) + 1):
        for c in range(max(extent[0], column - GROWN), min(extent[2], column + GROWN) + 1):
            if seen[r, c] == mark:
                return True
    return False


@kernel
def _gather(
    luma: Image,
    light: Array,
    slope_of: Array,
    box: Box,
    extent: Box,
    mark: int,
    seen: Image,
    ring: Box,
    arms: Array,
    peak: float,
    share: float,
    sums: Array,
) -> None:
    """The sums over a spot's pixels that are more than a share LED, of a `peak` light; less ground.

    Places are from the middle of its extent.
    """
    u0, v0 = box[0] + 0.5 * (extent[0] + extent[2]), box[1] + 0.5 * (extent[1] + extent[3])
    sums[:] = 0.0
    rows, columns = box[3] - box[1], box[2] - box[0]
    for r in range(max(extent[1] - GROWN, 0), min(extent[3] + GROWN, rows) + 1):
        for c in range(max(extent[0] - GROWN, 0), min(extent[2] + GROWN, columns) + 1):
            grey = luma[box[1] + r, box[0] + c]
            if not light[grey] > arms[LEVEL] or not is_near(seen, mark, r, c, extent):
                continue
            ground = ground_at(luma, light, ring, arms, box[0] + c, box[1] + r)
            scale = (peak - arms[LEVEL]) / (peak - ground)  # an LED covers what is behind it
            floor = ground + share * (peak - ground)
            slope, weight = scale * slope_of[grey], scale * (light[grey] - floor)
            if weight <= 0.0:
                continue
            du, dv = box[0] + c - u0, box[1] + r - v0
            sums[WEIGHT] += weight
            sums[SU] += weight * du
            sums[SV] += weight * dv
            sums[SUU] += weight * du * du
            sums[SUV] += weight * du * dv
            sums[SVV] += weight * dv * dv
            if light[grey] - ground > SIZE_SHARE * (peak - ground):
                sums[COUNT] += 1.0
            for y, x in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                if 0 <= y <= rows and 0 <= x <= columns:
                    beside = scale * max(light[luma[box[1] + y, box[0] + x]] - floor, 0.0)
                    sums[STEP] = max(sums[STEP], weight - beside)
            if slope == 0.0:
                continue
            sums[N_UU] += (slope * du) ** 2
            sums[N_UV] += slope * slope * du * dv
            sums[N_VV] += (slope * dv) ** 2
            sums[D_U] += abs(du)
            sums[D_V] += abs(dv)


@kernel
def _doubt(spot: Array, sums: Array, top: float, relief2: float, coded_px: float) -> None:
    """The covariance of a spot with a `top` weight: noise, relief, edge, codec, motion blur."""
    whole2 = sums[WEIGHT] * sums[WEIGHT]
    noise2, relief2 = spot[NOISE] ** 2 / whole2, RELIEF_SHARE**2 * relief2 / whole2
    dim = min(max(DIM / spot[CONTRAST], 1.0), MOST_DIM)
    left = 1.0 - min(sums[STEP] / top, STEEPEST)  # of the light, beside the steepest edge
    edge_px = EDGE_PX / (left * sqrt(sqrt(sums[COUNT])))
    alike = MODEL_PX**2 + edge_px**2 + (coded_px * dim) ** 2
    spot[C_UU] = noise2 * sums[N_UU] + relief2 * sums[D_U] ** 2 + alike
    spot[C_UV] = noise2 * sums[N_UV]
    spot[C_VV] = noise2 * sums[N_VV] + relief2 * sums[D_V] ** 2 + alike
    half, tilt = 0.5 * (spot[UU] - spot[VV]), spot[UV]
    spread = 2.0 * sqrt(half * half + tilt * tilt)  # of the second moments: along minus across
    streak = max(sqrt(12.0 * spread) - ROUND_PX, 0.0)
    # of twice the angle of the streak
    cosine, sine = 2.0 * half / max(spread, 1e-9), 2.0 * tilt / max(spread, 1e-9)
    shape_uu, shape_uv, shape_vv = 0.5 * (1.0 + cosine), 0.5 * sine, 0.5 * (1.0 - cosine)
    own, shared = (OWN_MOTION_BLUR * streak) ** 2, (SHARED_MOTION_BLUR * streak) ** 2
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
    extent: Box,
    mark: int,
    edge: float,
    seen: Image,
    ring: Box,
    coded_px: float,
    spot: Array,
    work: Array,
) -> bool:
    """Measure a spot: its place, its size and its covariance; False if nothing rises, or no spot.

    Args:
        luma: The picture.
        light: (256,) about linear light of each grey level.
        slope_of: (256,) its slope; 0 where it is clipped.
        box: The window.
        extent: The box of the spot's members in the window.
        mark: Theirs in `seen`.
        edge: The light above which they are parted from an arm; 0 if there was no need.
        seen: Of the window.
        ring: Around the members, inside the picture.
        coded_px: What a codec adds to a bright spot's place.
        spot: (FIELDS,) its area and contrast are known, the rest is written.
        work: (n,) a ring's pixels or more.
    """
    n, middle = put_ring(luma, ring, work), border(luma, ring)
    noise, level = noise_of(work, n, middle), light[int(middle)]
    peak = 0.0
    for r in range(extent[1], extent[3] + 1):
        for c in range(extent[0], extent[2] + 1):
            peak = max(peak, light[luma[box[1] + r, box[0] + c]] if seen[r, c] == mark else 0.0)
    rise = peak - level
    if not rise > 0.0:
        return False
    most = max(MOST_OFF * rise, edge - level)  # an arm that was parted from it counts whole
    grain = noise * slope_of[min(int(middle) + DARKEST, 255)]
    relief2 = relief_of(light, work, n, level, most, grain)
    share = min(BY_RELIEF * sqrt(relief2) / rise, MOST_ABOVE)
    arms, sums = np.empty(ARMS), np.empty(SUMS)
    arms_of(luma, light, ring, level, most, arms)
    _gather(luma, light, slope_of, box, extent, mark, seen, ring, arms, peak, share, sums)
    whole = sums[WEIGHT]
    if not whole > 0.0:
        return False
    du, dv = sums[SU] / whole, sums[SV] / whole
    spot[U] = box[0] + 0.5 * (extent[0] + extent[2]) + du
    spot[V] = box[1] + 0.5 * (extent[1] + extent[3]) + dv
    spot[BRIGHTNESS], spot[NOISE], spot[AREA] = whole, noise, sums[COUNT]
    spot[UU], spot[VV] = sums[SUU] / whole - du * du, sums[SVV] / whole - dv * dv
    spot[UV] = sums[SUV] / whole - du * dv
    if not spot[UU] * spot[VV] - spot[UV] * spot[UV] > 1e-6:
        return False
    _doubt(spot, sums, (1.0 - share) * rise, relief2, coded_px)
    if edge > 0.0:
        merged = MERGED * MERGED * spot[AREA] / pi * (most / rise) ** 2
        spot[C_UU] += merged
        spot[C_VV] += merged
    return bool(spot[C_UU] + spot[C_VV] < LEAST_SURE_PX**2)
