"""Compiled P3P hypotheses: every three spots as three LEDs, where the attitude is unknown.

All triples are tried, unlike in RANSAC (Fischler & Bolles, Comm. ACM 24 (1981) 381): there are few
LEDs, and which hypothesis to believe is decided by `false_alarm_kernels`.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from pipeline.frames import Array
from pipeline.identification.association_kernels import (
    BinnedSpots,
    Integers,
    is_complete,
    name_near,
)
from pipeline.identification.initialisation_kernels import (
    BOUNDED,
    FEW_PX,
    LOOKED,
    MAX_RANGE_M,
    MIN_RANGE_M,
    Wanted,
    Work,
    consider,
    is_new,
    spent,
)
from pipeline.identification.p3p_kernels import p3p, put_triad
from pipeline.so3_kernels import kernel

TRIPLE_PX = 8.0
"""How far LEDs may be from where three others put them: noise, magnified."""
P3P_COST = 10
"""Of four poses, in looks."""
SPLIT = 0.02
"""How far noise may split a pair of poses that are one."""
TRIPLE_RATIO = 12.0
"""So different may the areas of three LEDs' spots be, near or far."""


class _Corners(NamedTuple):
    """Three LEDs, and memory for the poses from which they are seen."""

    which: Integers
    """(3,)."""
    points: Array
    """(3, 3) in b, by rows."""
    triad: Array
    """(3, 3) of the points."""
    rays: Array
    """(3, 3) unit vectors, by rows."""
    ps: Array
    """(4, 3)."""
    Rs: Array
    """(4, 3, 3)."""


@kernel
def _corners(which: Integers, leds: Array) -> _Corners:
    points, triad = np.empty((3, 3)), np.empty((3, 3))
    for k in range(3):
        points[k] = leds[which[k]]
    put_triad(points[0], points[1], points[2], triad)
    return _Corners(which, points, triad, np.empty((3, 3)), np.empty((4, 3)), np.empty((4, 3, 3)))


@kernel
def _are_alike(areas: Array, i: int, j: int, k: int) -> bool:
    """Whether three spots could be LEDs of one robot, by their areas."""
    low = min(areas[i], areas[j], areas[k]) + FEW_PX
    alike: bool = max(areas[i], areas[j], areas[k]) - FEW_PX < TRIPLE_RATIO * low
    return alike


@kernel
def _are_distinct(names: Integers) -> bool:
    """Whether no spot has two names."""
    for a in range(names.shape[0]):
        for b in range(a):
            if names[a] >= 0 and names[a] == names[b]:
                return False
    return True


@kernel
def _try_triple(
    three: tuple[int, int, int], corners: _Corners, wanted: Wanted, lights: BinnedSpots, work: Work
) -> None:
    """Three spots as three LEDs: up to four poses."""
    work.counters[LOOKED] += P3P_COST
    for k in range(3):
        y, z = lights.tangents[three[k], 0], lights.tangents[three[k], 1]
        size = sqrt(1.0 + y * y + z * z)
        corners.rays[k, 0], corners.rays[k, 1], corners.rays[k, 2] = 1.0 / size, y / size, z / size
    leds, reach, c = wanted.leds, TRIPLE_PX / wanted.f, corners
    names = np.empty(leds.shape[0], dtype=np.int64)
    for root in range(p3p(c.rays, c.points, c.triad, SPLIT, c.ps, c.Rs)):
        p, R = c.ps[root], c.Rs[root]
        if not MIN_RANGE_M < p[0] < MAX_RANGE_M:
            continue
        if not is_complete(p, R, leds, leds.shape[0] - wanted.least, reach, lights):
            continue
        name_near(p, R, leds, reach, lights, names)
        for k in range(3):
            names[c.which[k]] = three[k]
        if _are_distinct(names) and is_new(names, root, work):
            consider(p, R, names, wanted, lights, work)


@kernel
def p3p_hypotheses(
    which: Integers, start: int, budget: int, wanted: Wanted, lights: BinnedSpots, work: Work
) -> int:
    """Add explanations of the spots by a robot in any attitude.

    Args:
        which: (3,) LEDs that any three spots may be.
        start: With which triple of spots to begin.
        budget: Work, in looks at a hypothesis.
        wanted: The robot.
        lights: The spots.
        work: Explanations are added.

    Returns:
        With which triple of spots to go on; 0 after the last one.
    """
    n, areas = lights.tangents.shape[0], lights.areas
    corners = _corners(which, wanted.leds)
    for at in range(start, n * n * n):
        i, j, k = at // (n * n), (at // n) % n, at % n
        if i in (j, k) or j == k or not _are_alike(areas, i, j, k):
            continue
        if spent(work) > budget:
            work.counters[BOUNDED] = 1
            return at
        _try_triple((i, j, k), corners, wanted, lights, work)
    return 0
