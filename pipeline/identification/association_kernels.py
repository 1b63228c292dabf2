"""Compiled data association: which spot lies where an LED is predicted.

Spots are given as tangents (y/x, z/x) of their rays in c, at most `CANDIDATES` of them, so that a
set of spots is the bits of one integer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array
from pipeline.so3_kernels import kernel

Integers = npt.NDArray[np.int64]
CANDIDATES = 60  # spots, at most
BINS = 128  # by axis


class BinnedSpots(NamedTuple):
    """The spots of one instant, and where to find them."""

    tangents: Array
    """(n, 2) y/x and z/x."""
    areas: Array
    """(n,) [px²]."""
    below: Integers
    """(2, BINS + 1): which spots lie in lower bins, by axis."""
    scale: Array
    """(2, 2) by axis: where the first bin starts, bins per unit."""


def lights_of(tangents: Array, areas: Array) -> BinnedSpots:
    """Sort spots into bins."""
    below, scale = np.zeros((2, BINS + 1), dtype=np.int64), np.zeros((2, 2))
    index_spots(tangents, below, scale)
    return BinnedSpots(tangents, areas, below, scale)


@kernel
def index_spots(tangents: Array, below: Integers, scale: Array) -> None:
    """Fill `below` and `scale` of `BinnedSpots`."""
    n = tangents.shape[0]
    for axis in range(2):
        low, high = tangents[0, axis], tangents[0, axis]
        for s in range(n):
            low, high = min(low, tangents[s, axis]), max(high, tangents[s, axis])
        scale[axis, 0], scale[axis, 1] = low, BINS / (high - low + 1e-6)
        for b in range(BINS + 1):
            below[axis, b] = 0
        for s in range(n):
            b = int((tangents[s, axis] - low) * scale[axis, 1])
            below[axis, min(b, BINS - 1) + 1] |= 1 << s
        for b in range(BINS):
            below[axis, b + 1] |= below[axis, b]


@kernel
def nearest(y: float, z: float, reach: float, lights: BinnedSpots) -> tuple[int, float]:
    """The spot nearest to (y, z), if it is within `reach`, and its squared distance; −1 if none."""
    mask = -1
    for axis in range(2):
        at = y if axis == 0 else z
        low = (at - reach - lights.scale[axis, 0]) * lights.scale[axis, 1]
        high = (at + reach - lights.scale[axis, 0]) * lights.scale[axis, 1]
        if not (high >= 0.0 and low < BINS):
            return -1, 0.0
        first, last = int(max(low, 0.0)), int(min(high, BINS - 1.0))
        mask &= lights.below[axis, last + 1] & ~lights.below[axis, first]
    best, which, s = reach * reach, -1, 0
    while mask > 0:
        if mask & 1:
            dy, dz = lights.tangents[s, 0] - y, lights.tangents[s, 1] - z
            d2 = dy * dy + dz * dz
            if d2 < best:
                best, which = d2, s
        mask >>= 1
        s += 1
    return which, best


@kernel
def place(p: Array, R: Array, leds: Array, k: int) -> tuple[float, float, float]:
    """LED k in c: its distance ahead [m] and the tangents of its ray."""
    x = p[0] + R[0, 0] * leds[k, 0] + R[0, 1] * leds[k, 1] + R[0, 2] * leds[k, 2]
    y = p[1] + R[1, 0] * leds[k, 0] + R[1, 1] * leds[k, 1] + R[1, 2] * leds[k, 2]
    z = p[2] + R[2, 0] * leds[k, 0] + R[2, 1] * leds[k, 1] + R[2, 2] * leds[k, 2]
    return x, y / x, z / x


@kernel
def is_complete(
    p: Array, R: Array, leds: Array, allowed: int, reach: float, lights: BinnedSpots
) -> bool:
    """Whether no more than `allowed` LEDs are without a spot in reach."""
    missed = 0
    for k in range(leds.shape[0]):
        x, y, z = place(p, R, leds, k)
        if x < NEAREST_M:
            return False
        spot, _ = nearest(y, z, reach, lights)
        if spot < 0:
            missed += 1
            if missed > allowed:
                return False
    return True


@kernel
def name_near(
    p: Array, R: Array, leds: Array, reach: float, lights: BinnedSpots, names: Integers
) -> int:
    """Give each LED the spot within `reach` of where it should be; returns how many have one."""
    count = 0
    taken_d2 = np.empty(leds.shape[0])
    for k in range(leds.shape[0]):
        names[k] = -1
    for k in range(leds.shape[0]):
        x, y, z = place(p, R, leds, k)
        if x < NEAREST_M:
            return 0
        spot, d2 = nearest(y, z, reach, lights)
        for other in range(k):  # a spot is one LED: the nearer one
            if spot >= 0 and names[other] == spot:
                if taken_d2[other] <= d2:
                    spot = -1
                else:
                    names[other] = -1
                    count -= 1
        if spot >= 0:
            names[k], taken_d2[k] = spot, d2
            count += 1
    return count
