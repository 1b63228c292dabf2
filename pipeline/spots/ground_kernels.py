"""Compiled: the ground around a spot, its noise, and how far it is from even."""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel

Box = npt.NDArray[np.int64]
LAG, MOST_BEND = 2, 150.0
"""Pixels between those that are compared, and grey levels beyond which it is no noise."""
FEWEST_NOISE = 0.29  # grey levels: of rounding to them
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
