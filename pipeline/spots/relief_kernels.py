"""Compiled: the places of a picture's relief that may be LEDs; bounded, however bright the room."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.jit import numba
from pipeline.signals import Image
from pipeline.so3_kernels import kernel
from pipeline.spots.spot_kernels import SHARES, WINDOW

MOST_PIXELS = 8000
"""Of the relief that are looked at: the highest, each of which may be a place by itself."""
GLARING = 2
"""What is left out is worth a word if it is so many times as high as the least."""
RIM = 2
"""Pixels of a place's skirt that are no place of their own."""
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
def _flood(relief: Image, row: int, column: int, level: int, stack: Places, place: Places) -> int:
    """Box and peak of the pixels above `level` about one, which are put to zero.

    Gives how many they are; `stack` (n, 3) has their rows, columns and heights.
    """
    height, width = relief.shape
    place[PEAK], place[LEFT], place[TOP] = relief[row, column], column, row
    place[RIGHT], place[BOTTOM] = column, row
    stack[0, 0], stack[0, 1], stack[0, 2] = row, column, relief[row, column]
    relief[row, column] = 0
    n, k = 1, 0
    while k < n:
        r, c = stack[k, 0], stack[k, 1]
        k += 1
        place[LEFT], place[RIGHT] = min(place[LEFT], c), max(place[RIGHT], c)
        place[TOP], place[BOTTOM] = min(place[TOP], r), max(place[BOTTOM], r)
        for rr in range(max(0, r - 1), min(height, r + 2)):
            for cc in range(max(0, c - 1), min(width, c + 2)):
                if relief[rr, cc] > level:
                    stack[n, 0], stack[n, 1], stack[n, 2] = rr, cc, relief[rr, cc]
                    relief[rr, cc] = 0
                    n += 1
    return n


@kernel
def _take(relief: Image, row: int, column: int, level: int, stack: Places, place: Places) -> None:
    """The place about a pixel, of those above `level`; it is put to zero with a rim.

    By the lowest share that leaves one no larger than a window, or else by the lowest of all.
    """
    height, width = relief.shape
    peak, n = relief[row, column], 0
    for share in SHARES:
        n = _flood(relief, row, column, max(level, int(share * peak)), stack, place)
        if max(place[RIGHT] - place[LEFT], place[BOTTOM] - place[TOP]) < WINDOW:
            break
        for k in range(n):
            relief[stack[k, 0], stack[k, 1]] = stack[k, 2]
        n = 0
    if n == 0:
        n = _flood(relief, row, column, max(level, int(SHARES[0] * peak)), stack, place)
    for k in range(n):
        r, c = stack[k, 0], stack[k, 1]
        for rr in range(max(0, r - RIM), min(height, r + RIM + 1)):
            for cc in range(max(0, c - RIM), min(width, c + RIM + 1)):
                relief[rr, cc] = 0


@numba.njit(
    (_RELIEF, numba.int64, _PLACES),
    cache=True,
    error_model="numpy",
)
def bright_places(relief: Image, least: int, places: Places) -> tuple[int, int]:
    """Boxes about the highest pixels: how many, and 1 if bright ones were left out.

    A place ends where it falls below a share of its peak: an arm that carries an LED is another.

    Args:
        relief: What rises above its surround; overwritten.
        least: Level from which on pixels count, if there are not too many.
        places: (k, PLACE) written, highest peak first.
    """
    level, count = _threshold(relief, least)
    at, stack = np.empty((count, 2), dtype=np.int32), np.empty((count + 1, 3), dtype=np.int32)
    peaks = np.empty(count, dtype=np.int64)
    height, width = relief.shape
    n, taken = 0, 0
    for row in range(height):
        line = relief[row]
        for column in range(width):
            if line[column] > level:
                at[n, 0], at[n, 1], peaks[n] = row, column, line[column]
                n += 1
    order = np.argsort(-peaks, kind="mergesort")
    dropped = level
    for k in order:
        row, column = at[k]
        peak = relief[row, column]
        if peak <= level:
            continue
        if taken == len(places):
            dropped = peak
            break
        _take(relief, row, column, level, stack, places[taken])
        taken += 1
    return taken, int(dropped > GLARING * least)
