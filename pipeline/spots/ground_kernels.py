"""Compiled: the ground around a spot, its noise, and how far it is from even."""

from __future__ import annotations

from math import atan2, cos, inf, sin, sqrt

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel

Box = npt.NDArray[np.int64]
LAG, MOST_BEND = 2, 150.0
"""Pixels between those that are compared, and grey levels beyond which it is no noise."""
FEWEST_NOISE = 0.29  # grey levels: of rounding to them
LEVEL, MOST, AXIS_U, AXIS_V, ALIKE = range(5)
ARMS = 5
"""What a ring says of what lies behind a spot: its level, by how much arms are counted at most, the
axis they lie along, and which share of all relief does."""
BESIDE = 2  # pixels of a ring to each side of one, whose mean has less noise


@kernel
def border(luma: Image, box: Box) -> float:
    """Median of a box's border."""
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
def put_ring(luma: Image, box: Box, ring: Array) -> int:
    """Grey levels of a box's border, clockwise from its upper left corner; gives how many."""
    n = 0
    for u in range(box[0], box[2]):
        ring[n] = luma[box[1], u]
        n += 1
    for v in range(box[1], box[3]):
        ring[n] = luma[v, box[2]]
        n += 1
    for u in range(box[2], box[0], -1):
        ring[n] = luma[box[3], u]
        n += 1
    for v in range(box[3], box[1], -1):
        ring[n] = luma[v, box[0]]
        n += 1
    return n


@kernel
def noise_of(ring: Array, n: int, middle: float) -> float:
    """Noise in grey levels, by second differences: edges and slopes are none."""
    off, count = 0.0, 0
    for i in range(n):
        bend = abs(ring[i - LAG if i >= LAG else i - LAG + n] - 2.0 * ring[i] + ring[(i + LAG) % n])
        if bend < MOST_BEND:
            off += bend * bend / 6.0
            count += 1
    noise = max(sqrt(off / max(count, 1)), FEWEST_NOISE)
    return noise * (1.0 + max(0.0, 1.0 - 0.5 * middle / noise))  # half of it is clipped at black


@kernel
def relief_of(light: Array, ring: Array, n: int, level: float, most: float, noise: float) -> float:
    """Variance of a ring's light about a level, as far as it is no noise: arms, walls, neighbours.

    Args:
        light: (256,) about linear light of each grey level.
        ring: (n,) grey levels.
        n: How many.
        level: Light.
        most: Difference in light that is counted.
        noise: Of a pixel's light on the ring.
    """
    mean_of = 2 * BESIDE + 1
    total, variance = 0.0, 0.0
    for i in range(n - BESIDE, n + BESIDE):
        total += min(light[int(ring[i % n])] - level, most)
    for i in range(n):
        total += min(light[int(ring[(i + BESIDE) % n])] - level, most)
        variance += (total / mean_of) ** 2 / n
        total -= min(light[int(ring[(i - BESIDE + n) % n])] - level, most)
    return max(0.0, variance - noise * noise / mean_of)


@kernel
def arms_of(luma: Image, light: Array, ring: Box, level: float, most: float, arms: Array) -> None:
    """Along which axis a ring's relief lies: where arms leave it, or across an edge.

    Args:
        luma: The picture.
        light: (256,) about linear light of each grey level.
        ring: A box around a spot.
        level: Light.
        most: Difference in light that is counted.
        arms: (ARMS,) written: the mean of the doubled angles, as axes have one, weighted by relief.
    """
    u0, v0 = 0.5 * (ring[0] + ring[2]), 0.5 * (ring[1] + ring[3])
    cosine, sine, whole = 0.0, 0.0, 0.0
    for v in range(ring[1], ring[3] + 1):
        step = 1 if v == ring[1] or v == ring[3] else ring[2] - ring[0]
        for u in range(ring[0], ring[2] + 1, step):
            off = abs(min(light[luma[v, u]] - level, most))
            du, dv = u - u0, v - v0
            cosine += off * (du * du - dv * dv) / (du * du + dv * dv)
            sine += off * 2.0 * du * dv / (du * du + dv * dv)
            whole += off
    angle = 0.5 * atan2(sine, cosine)
    arms[LEVEL], arms[MOST], arms[AXIS_U], arms[AXIS_V] = level, most, cos(angle), sin(angle)
    arms[ALIKE] = sqrt(cosine * cosine + sine * sine) / max(whole, 1e-12)


@kernel
def ground_at(luma: Image, light: Array, ring: Box, arms: Array, u: int, v: int) -> float:
    """Light of the ground under a spot's pixel: as it is where the axis of arms meets the ring.

    An LED sits on its arm's end, and hides where it ends: it goes on to the ring's middle.
    """
    u0, v0 = 0.5 * (ring[0] + ring[2]), 0.5 * (ring[1] + ring[3])
    ahead = min(max(0.5 + 0.5 * ((u - u0) * arms[AXIS_U] + (v - v0) * arms[AXIS_V]), 0.0), 1.0)
    level, there = float(arms[LEVEL]), 0.0
    if ahead > 0.0:
        there += ahead * _met(luma, light, ring, u, v, arms[AXIS_U], arms[AXIS_V])
    if ahead < 1.0:
        there += (1.0 - ahead) * _met(luma, light, ring, u, v, -arms[AXIS_U], -arms[AXIS_V])
    return level + float(arms[ALIKE]) * min(there - level, float(arms[MOST]))


@kernel
def _met(luma: Image, light: Array, ring: Box, u: int, v: int, du: float, dv: float) -> float:
    """Light where a straight way from a place inside meets a ring, between pixels."""
    way = inf
    if du != 0.0:
        way = min(way, ((ring[2] if du > 0.0 else ring[0]) - u) / du)
    if dv != 0.0:
        way = min(way, ((ring[3] if dv > 0.0 else ring[1]) - v) / dv)
    x, y = u + way * du, v + way * dv
    c, r = min(max(int(x), ring[0]), ring[2] - 1), min(max(int(y), ring[1]), ring[3] - 1)
    right, low = x - c, y - r
    above = (1.0 - right) * light[luma[r, c]] + right * light[luma[r, c + 1]]
    below = (1.0 - right) * light[luma[r + 1, c]] + right * light[luma[r + 1, c + 1]]
    return float((1.0 - low) * above + low * below)
