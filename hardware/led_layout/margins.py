"""How well LEDs tell themselves apart: the smallest margin of any wrong naming, view by view.

A naming says which LED each spot is. The margin of a wrong one is the RMS reprojection error of the
pose that explains it best: small means that it can hardly be told from the right one.

Four spots leave 2 of their 8 coordinates to refute a naming, and views have 2 directions: knowing
nothing else, almost any layout has single views from which a wrong naming of four fits exactly. How
many there are matters then, not how small the smallest margin is.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations

import numpy as np

from hardware.led_layout.fit_kernels import FREE, TILT, TURN
from hardware.led_layout.margin_kernels import Indices, other_pose, smallest_wrong
from hardware.led_layout.viewpoints import LedLayoutError, Viewpoints, attitude, direction, seen
from pipeline.frames import Array

FEWEST, MOST = 4, 8
"""LEDs: fewer have no wrong naming to refute, with more there are too many to try."""
FAR_PX = 60.0
"""Margins are cut here: what fits so badly is no danger."""
KNOWN = ("nothing", "gravity", "attitude")
"""What a naming may know of the relative attitude."""
_KNOWN = (FREE, TILT, TURN)
WORST = 3
"""From how many of the worst views a still worse one is looked for."""
FINEST_RAD = 0.004
Progress = Callable[[Iterator[None]], None]
"""Is given something to iterate over, with a turn for each part of the work that is done."""


@dataclass(frozen=True, slots=True, eq=False)
class Margins:
    """The smallest margins; axes: view, distance, then as said."""

    wrong: Array
    """(k, d, 2, 3) over wrong namings of any four LEDs and of all, by `KNOWN` [px]."""
    other: Array
    """(k, d, 2) second pose of the worst rightly named four, and of all [px]; inf: none."""
    apart: Array
    """(k, d) between the two spots that are closest [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class Worst:
    """The view in which a wrong naming fits best."""

    margin_px: float
    angles: Array
    """(2,) azimuth and elevation [rad]."""
    naming: tuple[tuple[int, int], ...]
    """Spot of which LED, taken for which; those rightly named left out."""


@lru_cache(maxsize=16)
def namings(count: int, named: int) -> tuple[Indices, Indices]:
    """Wrong namings of `named` of `count` spots: (spots (h, named), LEDs (h, named))."""
    pairs = [
        (spots, leds)
        for spots in combinations(range(count), named)
        for leds in permutations(range(count), named)
        if leds != spots
    ]
    table = np.array(pairs, dtype=np.int64)
    return np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1])


def check(leds_in_b: Array) -> None:
    """Refuse LEDs that have no margins.

    Raises:
        LedLayoutError: too few, too many, or two in one place.
    """
    count = len(leds_in_b)
    if not FEWEST <= count <= MOST:
        raise LedLayoutError(f"{count} LEDs; from {FEWEST} to {MOST} can be judged")
    for i, j in combinations(range(count), 2):
        if np.linalg.norm(leds_in_b[i] - leds_in_b[j]) < 1e-3:
            raise LedLayoutError(f"LEDs {i + 1} and {j + 1} are in one place")


def wrong(
    leds_in_b: Array,
    looks: Viewpoints,
    angles: Array,
    distance: float,
    named: int,
    known: int,
    above: float = FAR_PX,
    only: Indices | None = None,
) -> tuple[float, int]:
    """Margin [px] of the worst wrong naming in one view, and which of `namings`.

    Args:
        leds_in_b: (n, 3) [m].
        looks: For the focal length and what is known.
        angles: (2,) the view.
        distance: [m].
        named: How many spots are.
        known: Which of `KNOWN`.
        above: Only what is below counts: else this is the margin, and −1 the naming.
        only: These namings instead of all.
    """
    R, f = attitude(direction(angles)), looks.focal_px
    px, (spots, names) = seen(leds_in_b, R, distance, f), namings(len(leds_in_b), named)
    if only is not None:
        spots, names = spots[only], names[only]
    limit = looks.limits[known]
    least, which = smallest_wrong(leds_in_b, px, f, R, _KNOWN[known], limit, spots, names, above)
    if only is not None and which >= 0:
        which = only[which]
    return float(least), int(which)


def margins(leds_in_b: Array, looks: Viewpoints, progress: Progress | None = None) -> Margins:
    """The smallest margins over all wrong namings, for each view and distance.

    Args:
        leds_in_b: (n, 3) [m].
        looks: The views.
        progress: Gets a turn per view.

    Raises:
        LedLayoutError: see `check`; or a camera among the LEDs.
    """
    check(leds_in_b)
    shape = (len(looks.angles), len(looks.distances))
    result = Margins(np.empty((*shape, 2, 3)), np.empty((*shape, 2)), np.empty(shape))

    def one(k: int) -> None:
        for d in range(shape[1]):
            _judge(leds_in_b, looks, k, d, result)

    in_threads(one, range(shape[0]), progress)
    return result


def in_threads(
    work: Callable[[int], object], items: Iterable[int], progress: Progress | None
) -> None:
    """Does it for each item, side by side: kernels let other threads run."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        turns = (None for _ in pool.map(work, items))
        if progress is not None:
            progress(turns)
        for _ in turns:
            pass


def _judge(leds_in_b: Array, looks: Viewpoints, k: int, d: int, result: Margins) -> None:
    count, distance = len(leds_in_b), float(looks.distances[d])
    for size, named in enumerate((4, count)):
        least = result.wrong[k, d, size]
        least[:] = FAR_PX
        for known in (2, 1, 0):  # what fits with more known fits with nothing known
            above = FAR_PX if known else float(least.min())
            view = looks.angles[k]
            least[known], _ = wrong(leds_in_b, looks, view, distance, named, known, above)
    R, f = attitude(direction(looks.angles[k])), looks.focal_px
    px = seen(leds_in_b, R, distance, f)
    fours = [list(c) for c in combinations(range(count), 4)]
    result.other[k, d, 0] = min(other_pose(leds_in_b[c], px[c], f, R)[0] for c in fours)
    result.other[k, d, 1] = other_pose(leds_in_b, px, f, R)[0]
    i, j = np.triu_indices(count, 1)
    result.apart[k, d] = np.linalg.norm(px[i] - px[j], axis=1).min()


def worst(
    leds_in_b: Array, looks: Viewpoints, found: Margins, d: int, size: int, known: int
) -> Worst:
    """The worst view between those of `found`: downhill in direction from the worst of them.

    Args:
        leds_in_b: (n, 3) [m].
        looks: The views.
        found: Their margins.
        d: Which distance.
        size: 0 for wrong namings of four, 1 of all.
        known: Which of `KNOWN`.
    """
    named, distance = (4, len(leds_in_b))[size], float(looks.distances[d])
    column = found.wrong[:, d, size, known]
    best = Worst(np.inf, looks.angles[0], ())
    for k in np.argsort(column)[:WORST]:
        at, least = looks.angles[k], float(column[k]) + 1e-6
        stride, which = looks.spacing_rad, -1
        least, which = wrong(leds_in_b, looks, at, distance, named, known, least)
        while stride > FINEST_RAD:
            stride *= 0.5
            for step in stride * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]):
                there = np.clip(at + step, *np.array(looks.window).T)
                less, naming = wrong(leds_in_b, looks, there, distance, named, known, least)
                if naming >= 0:
                    at, least, which = there, less, naming
        if least < best.margin_px:
            best = Worst(least, at, _mistaken(len(leds_in_b), named, which))
    return best


def _mistaken(count: int, named: int, which: int) -> tuple[tuple[int, int], ...]:
    if which < 0:
        return ()
    spots, leds = (table[which] for table in namings(count, named))
    return tuple((int(a), int(b)) for a, b in zip(spots, leds, strict=True) if a != b)


def thickness(leds_in_b: Array) -> tuple[float, float]:
    """RMS distance from the plane and from the line that fit the LEDs best [m]."""
    spread = np.linalg.svd(leds_in_b - leds_in_b.mean(axis=0), compute_uv=False)
    root = np.sqrt(len(leds_in_b))
    return float(spread[2] / root), float(np.hypot(spread[1], spread[2]) / root)
