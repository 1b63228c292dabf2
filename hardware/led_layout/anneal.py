"""A better LED layout within reach: simulated annealing from several starts.

What counts is the smallest margin of a wrong naming of four LEDs with gravity or the attitude known
and of all LEDs with nothing known; once that is `enough`, how well a pose can be known, which
should not become worse in any case. A search over few views finds the gaps between them: after each
stage the worst view of all is looked for, and asked from then on.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from time import sleep

import numpy as np

from hardware.led_layout.crlb import sigmas
from hardware.led_layout.margins import Progress, check, wrong
from hardware.led_layout.reach import Reach
from hardware.led_layout.viewpoints import Viewpoints
from pipeline.frames import Array

WARM, COLD = 0.5, 0.02
"""Temperatures at start and end, of the score [px]."""
LONG, SHORT = 0.3, 0.01
"""Steps at start and end, as a share of an LED's reach."""
STAGES = 4
SURE_PX, TIE_PX = 1.0, 0.05
"""What a logarithm of the pose's uncertainty counts, once margins are enough, and before."""
WORSE_PX = 15.0
"""What it costs to be less sure of a pose than now, by the logarithm: no margin is worth it."""
SWAP = np.sqrt(0.5)
"""RMS of two spots of four exchanged, of their distance: no margin can be larger."""
HOT = 16
"""Namings that are remembered."""
FEW = 40
"""Views that the search asks at first."""
MM = 1e-3  # [m]


@dataclass(frozen=True, slots=True)
class AnnealingOptions:
    """How long and how."""

    turns: int = 600
    """Layouts tried per start."""
    starts: int = 4
    seed: int = 1
    enough_px: float = 8.0
    """A margin beyond this is worth nothing more."""


def asked(count: int) -> tuple[tuple[int, int], ...]:
    """What the smallest margin is taken over: how many are named, and which of `KNOWN` is."""
    return ((count, 0), (4, 2), (4, 1)) if count > 4 else ((4, 2), (4, 1))


def apart_px(leds_in_b: Array, looks: Viewpoints) -> float:
    """The least distance of two spots over all views, without perspective [px]."""
    i, j = np.array(list(combinations(range(len(leds_in_b)), 2))).T
    arms = leds_in_b[i] - leds_in_b[j]
    along = looks.directions_in_b @ arms.T
    across2 = np.clip(np.sum(arms**2, axis=1) - along**2, 0.0, None)
    return looks.focal_px / float(looks.distances[0]) * float(np.sqrt(across2.min()))


class _Evaluator:
    """Scores layouts by views that it learns."""

    def __init__(self, looks: Viewpoints, enough_px: float, now: Array) -> None:
        self._looks, self._enough_px = looks, enough_px
        chosen = np.linspace(0, len(looks.angles) - 1, min(FEW, len(looks.angles))).astype(int)
        self._some = replace(looks, angles=looks.angles[chosen])
        self._angles = list(looks.angles[chosen])
        self._now = self._unsure(now)
        self._hot: dict[tuple[int, int], list[int]] = {}

    def score(self, leds_in_b: Array, at_least: float = -np.inf) -> float:
        """Larger is better; −inf when below `at_least`."""
        parts = self._unsure(leds_in_b)
        unsure = float(parts.mean())
        worse = WORSE_PX * float(np.clip(parts - self._now, 0.0, None).max())
        bonus = -TIE_PX * unsure - worse
        margin = min(self._enough_px, SWAP * apart_px(leds_in_b, self._looks))
        if margin + bonus >= at_least:
            margin = self._margin(leds_in_b, margin, at_least - bonus)
        if margin >= self._enough_px:
            return self._enough_px - SURE_PX * unsure - worse
        return margin + bonus if margin + bonus >= at_least else -np.inf

    def learn(self, leds_in_b: Array) -> float:
        """Looks for the worst view of all, asks it from now on, and tells its margin [px]."""
        least, where = np.inf, self._angles[0]
        for at in [*self._looks.angles, *self._angles]:
            margin = self._of(leds_in_b, at, least)
            if margin < least:
                least, where = margin, at
        stride = self._looks.spacing_rad
        while stride > 0.01:
            stride *= 0.6
            for step in stride * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]):
                there = np.clip(where + step, *np.array(self._looks.window).T)
                margin = self._of(leds_in_b, there, least)
                if margin < least:
                    least, where = margin, there
        self._angles.insert(0, where)
        return least

    def _margin(self, leds_in_b: Array, least: float, at_least: float) -> float:
        """The smallest over the views [px]; stops below `at_least`, then asks that view first.

        Namings that were the worst lately are asked first: most layouts fail by one of them.
        """
        for hot in (True, False):
            for place, at in enumerate(self._angles):
                least = self._of(leds_in_b, at, least, hot)
                if least < at_least:
                    self._angles.insert(0, self._angles.pop(place))
                    return least
        return least

    def _of(self, leds_in_b: Array, at: Array, above: float, hot: bool = False) -> float:
        z = float(self._looks.distances[0])
        for kind in asked(len(leds_in_b)):
            lately = self._hot.setdefault(kind, [0])
            only = np.array(lately) if hot else None
            above, which = wrong(leds_in_b, self._looks, at, z, *kind, above, only)
            if which >= 0:
                if which in lately:
                    lately.remove(which)
                lately.insert(0, which)
                del lately[HOT:]
        return above

    def _unsure(self, leds_in_b: Array) -> Array:
        """Logarithms (3,) of the pose's worst uncertainty: across, along, rotation."""
        bound = sigmas(leds_in_b, self._some, 1.0)
        return np.log([part.max() for part in (bound.lateral, bound.depth, bound.rotation)])


def improve(
    leds_in_b: Array,
    reaches: Sequence[Reach],
    looks: Viewpoints,
    search: AnnealingOptions,
    progress: Progress | None = None,
) -> Array:
    """The best layout (n, 3) found, in whole millimetres where the reach allows.

    Args:
        leds_in_b: (n, 3) [m] as it is now: returned if nothing better is found.
        reaches: How far each may be moved.
        looks: The views; its first distance counts.
        search: How long.
        progress: Gets a turn per layout tried.

    Raises:
        LedLayoutError: the LEDs can't be judged.
    """
    check(leds_in_b)
    ticks: list[None] = []
    one = partial(_anneal, leds_in_b, reaches, looks, search, ticks)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        runs = [pool.submit(one, start) for start in range(search.starts)]
        if progress is not None:
            progress(_counted(ticks, lambda: all(run.done() for run in runs)))
        found = [run.result() for run in runs]
    judge = _Evaluator(looks, search.enough_px, leds_in_b)
    for layout in (leds_in_b, *found):  # all by the same views, the worst of each among them
        judge.learn(layout)
    return max((leds_in_b, *found), key=judge.score)


def _counted(ticks: list[None], done: Callable[[], bool]) -> Iterator[None]:
    """Count turns by ticks, as they come."""
    counted = 0
    while counted < len(ticks) or not done():
        if counted < len(ticks):
            counted += 1
            yield None
        else:
            sleep(0.02)


def _anneal(
    now: Array,
    reaches: Sequence[Reach],
    looks: Viewpoints,
    search: AnnealingOptions,
    ticks: list[None],
    start: int,
) -> Array:
    rng, judge = (
        np.random.default_rng([search.seed, start]),
        _Evaluator(looks, search.enough_px, now),
    )
    leds = now if start == 0 else np.array([reach.anywhere(rng) for reach in reaches])
    best = leds
    for turn in range(search.turns):
        if turn % max(1, search.turns // STAGES) == 0:
            judge.learn(best)
            leds = best
            score = best_score = judge.score(best)
        share = turn / search.turns
        heat, stride = WARM * (COLD / WARM) ** share, LONG * (SHORT / LONG) ** share
        moved = _moved(leds, reaches, stride, rng)
        needed = score + heat * float(np.log(rng.uniform()))
        tried = judge.score(moved, needed)
        ticks.append(None)
        if tried >= needed:
            leds, score = moved, tried
        if score > best_score:
            best_score, best = score, leds
    return best


def _moved(leds: Array, reaches: Sequence[Reach], stride: float, rng: np.random.Generator) -> Array:
    """Move one or two LEDs within their reach, to whole millimetres where that is within."""
    moved = leds.copy()
    for k in rng.choice(len(leds), rng.integers(1, 3), replace=False):
        place = reaches[k].nearest(moved[k] + stride * reaches[k].size * rng.normal(size=3))
        rounded = np.round(np.round(place / MM) * MM, 6)
        within = float(np.linalg.norm(reaches[k].nearest(rounded) - rounded)) < 1e-9
        moved[k] = rounded if within else place
    return moved
