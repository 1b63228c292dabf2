"""Compiled: the places of a picture's relief that may be LEDs; bounded, however bright the room."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.jit import numba
from pipeline.signals import Image
from pipeline.so3_kernels import kernel

MOST_PIXELS = 8000
"""Of the relief that are looked at: the highest, each of which may be a place by itself."""
GLARING = 2
"""What is left out is worth a word if it is so many times as high as the least."""
PEAK, LEFT, TOP, RIGHT, BOTTOM = range(5)
PLACE = 5  # numbers of a place

_RELIEF = numba.types.Array(numba.uint8, 2, "C")
_PLACES = numba.int32[:, ::1]
Places = npt.NDArray[np.int32]


@kernel
def _threshold(relief: Image, least: int) -> tuple[int, int]:
    """The lowest level from `least` on above which there are not too many pixels; and how many."""
    counts = np.zeros(256, dtype=np.int64)
    height, width = relief.shape
    for row in range(height):
        line = relief[row]
        for column in range(width):
            if line[column] > least:
                counts[line[column]] += 1
    level, n = 255, 0
    while level > least and n + counts[level] <= MOST_PIXELS:
        n += counts[level]
        level -= 1
    return level, n


@kernel
def _flood(relief: Image, row: int, column: int, level: int, stack: Places, place: Places) -> None:
    """Box and peak of the pixels above `level` about one, which are then put to zero."""
    height, width = relief.shape
    place[PEAK], place[LEFT], place[TOP] = 0, column, row
    place[RIGHT], place[BOTTOM] = column, row
    place[PEAK], relief[row, column] = relief[row, column], 0
    stack[0, 0], stack[0, 1] = row, column
    n = 1
    while n > 0:
        n -= 1
        r, c = stack[n, 0], stack[n, 1]
        place[LEFT], place[RIGHT] = min(place[LEFT], c), max(place[RIGHT], c)
        place[TOP], place[BOTTOM] = min(place[TOP], r), max(place[BOTTOM], r)
        for rr in range(max(0, r - 1), min(height, r + 2)):
            for cc in range(max(0, c - 1), min(width, c + 2)):
                if relief[rr, cc] > level:
                    place[PEAK] = max(place[PEAK], relief[rr, cc])
                    relief[rr, cc] = 0
                    stack[n, 0], stack[n, 1] = rr, cc
                    n += 1


@numba.njit(
    (_RELIEF, numba.int64, _PLACES),
    cache=True,
    error_model="numpy",
)
def bright_places(relief: Image, least: int, places: Places) -> tuple[int, int]:
    """Boxes of connected pixels above a level: how many, and 1 if bright ones were left out.

    Args:
        relief: What rises above its surround; overwritten.
        least: Level from which on pixels count, if there are not too many.
        places: (k, PLACE) written, highest peak first.
    """
    level, count = _threshold(relief, least)
    found = np.empty((count, PLACE), dtype=np.int32)
    stack = np.empty((count + 1, 2), dtype=np.int32)
    height, width = relief.shape
    n = 0
    for row in range(height):
        line = relief[row]
        for column in range(width):
            if line[column] > level:
                _flood(relief, row, column, level, stack, found[n])
                n += 1
    order = np.argsort(-found[:n, PEAK], kind="mergesort")
    taken = min(n, len(places))
    for k in range(taken):
        places[k] = found[order[k]]
    dropped = level if n == taken else max(level, int(found[order[taken], PEAK]))
    return taken, int(dropped > GLARING * least)
