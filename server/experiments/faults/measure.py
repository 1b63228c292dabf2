"""All seeds of a fault: the worst of each, and which goals were missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from server.experiments.faults.fault import Fault, Outcome, misses

EVENTS = ("COAST", "HOLD", "RAMP", "robot", "zero")


@dataclass(frozen=True, slots=True)
class Row:
    """The latest of each event [s], NaN where it did not follow; the largest of what is a size."""

    fault: str
    hazard: str
    COAST: float
    HOLD: float
    RAMP: float
    robot: float
    zero: float
    follows: str
    """In how many of the flights it tracks at the end."""
    excursion_mm: float
    tilt_deg: float
    after_zero: int
    words: str
    missed: str


def row_of(fault: Fault, outcomes: Sequence[Outcome]) -> Row:
    """Figures of a fault."""

    def latest(event: str) -> float:
        times = [one.first[event] for one in outcomes if event in one.first]
        return max(times, default=float("nan"))

    missed = dict.fromkeys(why for one in outcomes for why in misses(fault, one))
    said = [one.words for one in outcomes if one.words]
    return Row(
        fault=fault.name,
        hazard=fault.hazard,
        **{event: latest(event) for event in EVENTS},
        follows=f"{sum(one.follows for one in outcomes)}/{len(outcomes)}",
        excursion_mm=max(one.excursion_mm for one in outcomes),
        tilt_deg=max(one.tilt_deg for one in outcomes),
        after_zero=sum(one.after_zero for one in outcomes if fault.end == "zero"),
        words=said[-1] if said else "",
        missed="; ".join(missed),
    )


def percentile(outcomes: Sequence[Outcome], event: str, percent: float) -> float:
    """When an event followed [s]; infinite if it did not often enough; NaN of none."""
    times = [one.first.get(event, float("inf")) for one in outcomes]
    return float(np.percentile(times, percent, method="higher")) if times else float("nan")
