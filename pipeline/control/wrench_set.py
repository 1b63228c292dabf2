"""Which wrenches thrusters of limited thrust can give: a zonotope, as its faces.

{A f : low ≤ f ≤ high} is bounded by pairs of parallel faces; each is spanned by all but one
dimension's worth of thrusters, so the normals are known once and a wrench is compared with them in
microseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice
from math import comb, inf
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.jit import numba

FLAT: Final = 1e-6
"""Relative size below which thrusters span no face, or a face is the same as another."""
BATCH: Final = 4096
MOST_FACES: Final = 30_000
"""More candidates than this make no robot: 16 thrusters on six axes have 4368."""


class WrenchSet:
    """All wrenches of k axes that m thrusters give."""

    def __init__(self, A: Array, low: float, high: float) -> None:
        """Of A (k, m), whose rank must be k; thrusts in [low, high] [N].

        Raises:
            ValueError: some axis can't be driven, or there are too many thrusters.
        """
        axes, thrusters = A.shape
        self._size = np.linalg.norm(A, axis=1)
        if not self._size.all() or np.linalg.matrix_rank(A / self._size[:, None], FLAT) < axes:
            raise ValueError(f"allocation matrix: rank below its {axes} axes; drive fewer axes")
        if comb(thrusters, axes - 1) > MOST_FACES:
            raise ValueError(f"allocation matrix: {thrusters} thrusters; allowed: 16 on six axes")
        scaled = A / self._size[:, None]
        normals = _normals(scaled)
        along = normals @ scaled
        lift = np.where(along > 0.0, high, low), np.where(along > 0.0, low, high)
        self._normals = np.ascontiguousarray(np.vstack((normals, -normals)) / self._size)
        self._reach = np.concatenate(((along * lift[0]).sum(1), -(along * lift[1]).sum(1)))
        self.shares(np.ones(axes))  # compiles or loads the kernel here: never inside the loop

    def shares(self, wrench: Array) -> tuple[float, float]:
        """Between which factors (least, largest) a wrench (k,) can be given; inf, -inf: none."""
        least, largest = _shares(self._normals, self._reach, wrench)
        return (least, largest) if least <= largest else (inf, -inf)


def _normals(A: Array) -> Array:
    """(n, k) unit normals of the faces, one of each parallel pair."""
    axes, thrusters = A.shape
    if axes == 1:
        return np.ones((1, 1))
    found = [np.zeros((0, axes))]
    for chosen in _choices(thrusters, axes - 1):
        spans = A.T[chosen]  # (batch, k - 1, k)
        _, sizes, rows = np.linalg.svd(spans)
        found.append(rows[sizes[:, -1] > FLAT, -1])
    normals = np.vstack(found)
    first = np.argmax(np.abs(normals) > 0.1 / np.sqrt(axes), axis=1)
    normals *= np.sign(np.take_along_axis(normals, first[:, None], axis=1))
    _, one_of_each = np.unique(np.round(normals / FLAT), axis=0, return_index=True)
    return np.asarray(normals[one_of_each])


def _choices(thrusters: int, count: int) -> Iterator[list[tuple[int, ...]]]:
    """All sets of so many thrusters, in batches."""
    every = combinations(range(thrusters), count)
    while batch := list(islice(every, BATCH)):
        yield batch


@numba.njit(cache=True, error_model="numpy")
def _shares(normals: Array, reach: Array, wrench: Array) -> tuple[float, float]:
    """Interval of all s with s nᵀw ≤ reach for every face."""
    least, largest = -np.inf, np.inf
    for i in range(normals.shape[0]):
        along = 0.0
        for j in range(normals.shape[1]):
            along += normals[i, j] * wrench[j]
        if along > 0.0:
            largest = min(largest, reach[i] / along)
        elif along < 0.0:
            least = max(least, reach[i] / along)
        elif reach[i] < 0.0:
            return np.inf, -np.inf
    return least, largest
