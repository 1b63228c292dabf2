"""Figures of pressing: force against the band, contact lost, how soon, how deep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.config import PERIOD_S
from pipeline.frames import Array
from server.common.text import Column, flights
from server.experiments.contact.flight import PER_PERIOD, ContactTrace
from server.experiments.contact.setting import BAND_N, FULL, GO_S, STAY_S, ContactScene, Way
from server.experiments.paper.setup.measure import rms

SETTLE_S: Final = 2.0
"""After the hand has arrived; from then on until it goes back the force is to be in the band."""
SMOOTH_S: Final = 0.05
"""Over which the force is averaged; what is shorter counts as impact."""
IMPACT_S: Final = 0.5
"""After the first touch the force is the impact's, and no overshoot of control."""
LOST_MS: Final = 10
"""Without any touch for so long: contact is lost. Where the tip slides on the wall it rattles, for
a few milliseconds and micrometres at a time."""
STAYS_S: Final = 1.0
"""In the band for so long: settled."""


@dataclass(frozen=True, slots=True)
class Touching:
    """One flight."""

    mean_n: float
    """While pressing."""
    deviation_n: float
    """Standard deviation while pressing."""
    touching_pct: float
    """Milliseconds with any force, while pressing."""
    in_band_pct: float
    """Of the time of pressing."""
    impact_n: float
    """Largest force of a millisecond."""
    overshoot_pct: float
    """Of the averaged force beyond what is predicted, at its largest after the impact."""
    settling_s: float
    """From the first touch until it stays in the band for `STAYS_S`; NaN: never."""
    bounces: float
    """Contact lost and regained before `SETTLE_S` is over."""
    lost: float
    """... and after, while pressing."""
    deepest_mm: float
    """Of the tip behind the wall's face."""
    out: float
    """1 if the tip is before the wall's face in the end."""


@dataclass(frozen=True, slots=True)
class ContactRow:
    """A way of controlling in a scene: means over the seeds, `bounces` and `lost` in all."""

    scene: str
    way: str
    predicted_n: float
    """Middle of the band."""
    mean_n: float
    deviation_n: float
    touching_pct: float
    in_band_pct: float
    impact_n: float
    overshoot_pct: float
    settling_s: float
    bounces: int
    lost: int
    deepest_mm: float
    plugged: str
    """Flights in which the plug was in, of all; "" at a wall."""
    out: str
    """Flights that came back out, of all."""
    ended: str
    """Why tracking ended early, if it did; then there are no figures."""


COLUMNS: Final[tuple[Column, ...]] = (
    ("scene", "scene", "{}"),
    ("way", "controller", "{}"),
    ("predicted_n", "predicted N", "{:.2f}"),
    ("mean_n", "force N", "{:.2f}"),
    ("deviation_n", "± N", "{:.2f}"),
    ("touching_pct", "touching %", "{:.1f}"),
    ("in_band_pct", "in band %", "{:.1f}"),
    ("overshoot_pct", "overshoot %", "{:.0f}"),
    ("impact_n", "impact N", "{:.1f}"),
    ("settling_s", "settles s", "{:.2f}"),
    ("bounces", "bounces", "{}"),
    ("lost", "lost after", "{}"),
    ("deepest_mm", "deepest mm", "{:.1f}"),
    ("plugged", "plugged", "{}"),
    ("out", "back out", "{}"),
)


def table_of(rows: Sequence[ContactRow]) -> str:
    """One line a row."""
    return flights(COLUMNS, rows)


def smooth(force_n: Array) -> Array:
    """(n,) averaged over `SMOOTH_S`, as late as early."""
    width = round(SMOOTH_S / PERIOD_S) | 1
    padded = np.pad(force_n, width // 2, mode="edge")
    averaged: Array = np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
    return averaged


def touching(trace: ContactTrace, predicted_n: float) -> Touching:
    """Figures of a flight that did not end early."""
    pressing = (trace.t >= GO_S + SETTLE_S) & (trace.t < GO_S + STAY_S)
    force = smooth(trace.force_n)
    inside = np.abs(force - predicted_n) <= BAND_N
    touches = trace.peak_n > 0.0
    first = int(np.argmax(touches)) if touches.any() else len(trace.t)
    later = (np.arange(len(trace.t)) >= first + IMPACT_S / PERIOD_S) & (trace.t < GO_S + STAY_S)
    peak = float(force[later].max(initial=0.0))
    early = (np.arange(len(trace.t)) >= first) & (trace.t < GO_S + SETTLE_S)
    return Touching(
        mean_n=float(force[pressing].mean()),
        deviation_n=float(force[pressing].std()),
        touching_pct=100.0 * float(trace.pushes[np.repeat(pressing, PER_PERIOD)].mean()),
        in_band_pct=100.0 * float(inside[pressing].mean()),
        impact_n=float(trace.peak_n.max()),
        overshoot_pct=100.0 * (peak / predicted_n - 1.0),
        settling_s=settling(inside[first:]),
        bounces=gaps(np.repeat(early, PER_PERIOD), trace.pushes),
        lost=gaps(np.repeat(pressing, PER_PERIOD), trace.pushes),
        deepest_mm=1e3 * float(trace.depth_m.max()),
        out=float(trace.depth_m[-1] < 0.0),
    )


def settling(inside: npt.NDArray[np.bool_]) -> float:
    """After how long (n,) `inside` first lasts for `STAYS_S` [s]; NaN if it never does."""
    need = round(STAYS_S / PERIOD_S)
    runs = np.convolve(inside, np.ones(need), mode="valid") if len(inside) >= need else np.zeros(0)
    whole = np.flatnonzero(runs > need - 0.5)
    return PERIOD_S * float(whole[0]) if len(whole) else nan


def gaps(within: npt.NDArray[np.bool_], pushes: npt.NDArray[np.bool_]) -> int:
    """How often contact was lost for `LOST_MS` and regained in the time that counts, both (n,)."""
    touched = np.flatnonzero(pushes[within])
    return int((np.diff(touched) > LOST_MS).sum())


def row_of(
    scene: ContactScene, way: Way, predicted_n: float, traces: Sequence[ContactTrace]
) -> ContactRow:
    """Over the flights of a controller in a scene."""
    ended = next((trace.ended for trace in traces if trace.ended), "")
    ones = [] if ended else [touching(trace, predicted_n) for trace in traces]

    def mean(value: Callable[[Touching], float]) -> float:
        return float(np.mean([value(one) for one in ones])) if ones else nan

    depth_mm = 1e3 * scene.socket.depth_m if scene.socket else nan
    plugged = sum(one.deepest_mm >= FULL * depth_mm for one in ones)
    return ContactRow(
        scene=scene.name,
        way=way.name,
        predicted_n=predicted_n,
        mean_n=mean(lambda one: one.mean_n),
        deviation_n=rms(np.array([one.deviation_n for one in ones])),
        touching_pct=mean(lambda one: one.touching_pct),
        in_band_pct=mean(lambda one: one.in_band_pct),
        impact_n=max((one.impact_n for one in ones), default=nan),
        overshoot_pct=mean(lambda one: one.overshoot_pct),
        settling_s=mean(lambda one: one.settling_s),
        bounces=int(sum(one.bounces for one in ones)),
        lost=int(sum(one.lost for one in ones)),
        deepest_mm=mean(lambda one: one.deepest_mm),
        plugged=f"{plugged}/{len(traces)}" if scene.socket else "",
        out=f"{int(sum(one.out for one in ones))}/{len(traces)}",
        ended=ended,
    )
