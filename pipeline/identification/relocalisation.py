"""Relocalisation: all explanations of an image's spots without a pose, the likeliest first."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import pi, sin

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens import Camera
from pipeline.frames import Array, R_between, cross
from pipeline.identification.association_kernels import CANDIDATES, BinnedSpots, Integers, lights_of
from pipeline.identification.explanations import Explanation, ranked
from pipeline.identification.gravity_aided_kernels import upright
from pipeline.identification.initialisation_kernels import (
    BOUNDED,
    FITTED,
    FOUND,
    KEPT,
    LOOKED,
    ROW,
    TABLE,
    Wanted,
    Work,
)
from pipeline.identification.initialisation_kernels import FIT_COST as FIT
from pipeline.identification.p3p_hypothesis_kernels import p3p_hypotheses
from pipeline.signals import Spots
from pipeline.vision_config import IdentifyConfig

STEADY = 40
"""Of more candidates than can be tried these, the likeliest, always are; the others in turn."""
TIGHT_RAD, LOOSE_RAD, MOST_RAD = 0.05, 0.25, 0.2
"""How far LEDs may be off, as seen from the body, because gravity is not quite known: at the first,
quick search and at the second (pairs may magnify it); and how far gravity itself may be off."""
TIGHT, LOOSE = 120_000, 60_000
ALL, FEWER = 65_000, 30_000
"""Work of one picture, in looks at a hypothesis (0.1 µs)."""
FEW_LEDS, LEAST_LEDS = 8, 6
"""Of a robot with more than the former half are looked for, but no fewer than the latter: others
may be hidden, and chance explains no six."""
MANY = 14
"""Spots; among more, chance explains all LEDs but one as well if the attitude is unknown."""
LEAST_SHARE = 1e-4
"""Of all attitudes: none is remembered better."""

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class SearchHints:
    """What is known beside the spots; each may be missing."""

    up_in_c: Array | None = None
    """(3,) opposite of gravity."""
    up_in_b: Array | None = None
    R_cb: Array | None = None
    """(3, 3) expected attitude."""
    turn: float = pi
    """How far that may be off [rad]."""
    area_px_m2: float = 0.0
    """An LED's area times its depth squared; 0 if unknown."""

    @property
    def is_upright(self) -> bool:
        """Both verticals are known."""
        return self.up_in_c is not None and self.up_in_b is not None


class Relocalisation:
    """Looks for one robot in pictures of one camera; work left undone goes on in the next."""

    def __init__(self, camera: Camera, leds_in_b: Array, config: IdentifyConfig) -> None:
        """Nothing tried yet."""
        self._camera, self._config = camera, config
        self._leds = np.ascontiguousarray(leds_in_b, dtype=np.float64)
        self._radius_m = float(np.sqrt((leds_in_b**2).sum(axis=1).max()))
        self._has_many = len(self._leds) > FEW_LEDS
        self._triples = (_spread_triples if self._has_many else _triples)(self._leds)
        self._next = 0
        """Which of the triples comes next, of many LEDs."""
        self._turn = 0
        """Which of the less likely candidates are tried."""
        self._effort = 1.0
        self._at: dict[tuple[int, int], int] = {}
        """Where the next picture goes on, by LEDs demanded and triple."""
        counters, table = np.zeros(4, dtype=np.int64), np.zeros(TABLE, dtype=np.int64)
        self._work = Work(table, np.zeros((KEPT, ROW)), counters)
        self.bounded = False
        """The last picture had more to try than it could."""

    def explanations(
        self, spots: Spots, hints: SearchHints, effort: float = 1.0
    ) -> list[Explanation]:
        """Of the spots (those of one instant), the likeliest first; `effort` of the usual work."""
        self._effort = effort
        chosen = self._candidates(len(spots))
        self._work.counters[:] = 0
        self.bounded = len(chosen) < len(spots)
        if len(chosen) < self._config.min_leds:
            return []
        tangents = np.ascontiguousarray(-self._camera.normalised(spots.pixels[chosen]))
        lights = lights_of(tangents, np.ascontiguousarray(spots.area[chosen], dtype=np.float64))
        if hints.is_upright:
            self._upright(lights, hints)
        few = len(chosen) <= MANY
        if not hints.is_upright or (few and not self._work.counters[FOUND]):
            self._any_way(lights, hints)
        self.bounded = self.bounded or bool(self._work.counters[BOUNDED])
        rows = self._work.found[: self._work.counters[FOUND]]
        return ranked(rows, len(self._leds), chosen)

    @property
    def looked(self) -> int:
        """Work that the last picture took, in looks at a hypothesis."""
        counters = self._work.counters
        return int(counters[LOOKED] + FIT * counters[FITTED])

    def _candidates(self, n: int) -> Indices:
        """Of `n` spots those to try."""
        if n <= CANDIDATES:
            return np.arange(n)
        room = CANDIDATES - STEADY
        self._turn += room
        rest = STEADY + np.unique((np.arange(room) + self._turn) % (n - STEADY))
        return np.concatenate((np.arange(STEADY), rest))

    def _wanted(self, least: int, hints: SearchHints) -> Wanted:
        camera, config = self._camera, self._config
        ups, R_cb, turn = np.zeros((2, 3)), np.eye(3), pi
        if hints.R_cb is not None:
            R_cb, turn = np.ascontiguousarray(hints.R_cb), float(hints.turn)
        share = (turn - sin(turn)) / pi
        if hints.up_in_c is not None and hints.up_in_b is not None:
            ups[0], ups[1], share = hints.up_in_c, hints.up_in_b, turn / pi
        return Wanted(
            leds=self._leds,
            radius_m=self._radius_m,
            f=camera.focal_px,
            picture_px2=float(camera.width * camera.height),
            tolerance_px=config.tolerance_px,
            rms_px=config.start_rms_px,
            least=least,
            ups=ups,
            tilt_rad=MOST_RAD,
            R_cb=R_cb,
            turn_rad=turn,
            share=max(share, LEAST_SHARE),
            area_px_m2=float(hints.area_px_m2),
        )

    def _upright(self, lights: BinnedSpots, hints: SearchHints) -> None:
        """Quickly, then, unless all LEDs are found, with gravity less trusted."""
        wanted = self._wanted(self._config.min_leds, hints)
        level = R_between(wanted.ups[1], wanted.ups[0])
        for reach_rad, budget in ((TIGHT_RAD, TIGHT), (LOOSE_RAD, LOOSE)):
            found = self._work.found[: self._work.counters[FOUND], 0]
            if found.max(initial=0.0) == len(self._leds):
                return
            self._work.table[:] = 0
            reach_m = reach_rad * self._radius_m
            upright(level, reach_m, self._until(budget), wanted, lights, self._work)

    def _any_way(self, lights: BinnedSpots, hints: SearchHints) -> None:
        """All LEDs, and, unless they are found, all but one; of many LEDs half."""
        m = len(self._leds)
        self._work.table[:] = 0
        if self._has_many:
            self._half(self._wanted(max(LEAST_LEDS, (m + 1) // 2), hints), lights)
            return
        self._try(0, self._wanted(m, hints), lights, ALL)
        many = len(lights.tangents) > MANY
        if self._work.counters[FOUND] or many or m - 1 < self._config.min_leds:
            return
        wanted = self._wanted(m - 1, hints)
        for number in range(len(self._triples)):
            self._try(number, wanted, lights, FEWER // len(self._triples))

    def _half(self, wanted: Wanted, lights: BinnedSpots) -> None:
        """Triple after triple of LEDs, until one of those seen explains enough."""
        end = self.looked + ALL
        for _ in range(len(self._triples)):
            self._try(self._next, wanted, lights, end - self.looked)
            if self._work.counters[FOUND] or self._work.counters[BOUNDED]:
                return
            self._next = (self._next + 1) % len(self._triples)

    def _try(self, number: int, wanted: Wanted, lights: BinnedSpots, budget: int) -> None:
        """From where it was left in the last picture."""
        start, most = self._at.get((wanted.least, number), 0), len(lights.tangents) ** 3
        self._at[wanted.least, number] = p3p_hypotheses(
            self._triples[number],
            start if start < most else 0,
            self._until(budget),
            wanted,
            lights,
            self._work,
        )

    def _until(self, budget: int) -> int:
        """Looks until which work may go on."""
        return self.looked + int(self._effort * budget)


def _triples(leds_in_b: Array) -> Integers:
    """Large triangles of LEDs, such that without any one LED there still is one."""
    each = combinations(range(len(leds_in_b)), 3)
    order = sorted(each, key=lambda triple: _area2(leds_in_b, triple), reverse=True)
    chosen, missing = [], set(range(len(leds_in_b)))
    while missing:
        best = max(order, key=lambda triple: len(missing - set(triple)))
        chosen.append(best)
        if missing <= set(best):
            break  # of three LEDs there is only one
        missing &= set(best)
    return np.array(chosen, dtype=np.int64)


def _spread_triples(leds_in_b: Array) -> Integers:
    """Of each LED and its nearer half the largest triangle: seen whole where others are hidden."""
    half, chosen = (len(leds_in_b) + 1) // 2, set()
    for led in leds_in_b:
        near = np.argsort(((leds_in_b - led) ** 2).sum(axis=1), kind="stable")[:half]
        itself, others = int(near[0]), combinations(near[1:].tolist(), 2)
        triples = [(itself, int(a), int(b)) for a, b in others]
        a, b, c = sorted(triples[int(np.argmax([_area2(leds_in_b, three) for three in triples]))])
        chosen.add((a, b, c))
    order = sorted(chosen, key=lambda three: (-_area2(leds_in_b, three), three))
    return np.array(order, dtype=np.int64)


def _area2(leds_in_b: Array, triple: tuple[int, ...]) -> float:
    """Square of twice the area [m⁴]."""
    a, b, c = leds_in_b[list(triple)]
    normal = cross(b - a, c - a)
    return float(normal @ normal)
