"""Compiled translation voting: predicted LEDs are the spots that one common shift explains."""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.so3_kernels import kernel

Names = npt.NDArray[np.int64]
SHIFTS = 3.0
"""All LEDs together may be off by this many times what one may be after the common shift."""


@kernel
def _assign(
    expected: Array,
    seen: Array,
    shift_u: float,
    shift_v: float,
    reach: float,
    names: Names,
    taken: npt.NDArray[np.bool_],
) -> tuple[int, float]:
    """The nearest pairs first, each LED and spot once: names (n,), −1 for none; count and cost."""
    names[:], taken[:] = -1, False
    count, cost = 0, 0.0
    while True:
        best, led, spot = reach * reach, -1, -1
        for i in range(len(expected)):
            if names[i] >= 0:
                continue
            for s in range(len(seen)):
                if taken[s]:
                    continue
                du = expected[i, 0] + shift_u - seen[s, 0]
                dv = expected[i, 1] + shift_v - seen[s, 1]
                square = du * du + dv * dv
                if square < best:
                    best, led, spot = square, i, s
        if led < 0:
            return count, cost
        names[led], taken[spot] = spot, True
        count += 1
        cost += sqrt(best)


@kernel
def name_by_shift(expected: Array, seen: Array, reach: float, names: Names) -> int:
    """Associate by the common shift that most LEDs agree with; gives how many.

    LEDs shift together, lamps don't. Of namings of as many LEDs the one with the shortest distances
    is taken.

    Args:
        expected: (n, 2) [px]; NaN for an LED that can't be seen.
        seen: (m, 2) spots [px].
        reach: How far an LED may be from its place after the shift [px].
        names: (n,) spot of each LED or −1, written.
    """
    trial, taken = np.empty(len(expected), dtype=np.int64), np.empty(len(seen), dtype=np.bool_)
    names[:] = -1
    most, least_cost, far = 0, np.inf, SHIFTS * reach
    for i in range(len(expected)):
        for s in range(len(seen)):
            du, dv = seen[s, 0] - expected[i, 0], seen[s, 1] - expected[i, 1]
            if not (abs(du) <= far and abs(dv) <= far):
                continue
            count, cost = _assign(expected, seen, du, dv, reach, trial, taken)
            if count > most or (count == most and cost < least_cost):
                most, least_cost = count, cost
                names[:] = trial
    return most
