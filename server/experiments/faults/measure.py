"""All seeds of a fault: the worst of each, and which goals were missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from server.experiments.faults.fault import Fault, FaultOutcome, misses
from server.experiments.faults.live import LiveFault, LiveOutcome
from server.experiments.gaps.vanish import Vanished

EVENTS = ("COAST", "HOLD", "RAMP", "robot", "zero")


@dataclass(frozen=True, slots=True)
class FaultRow:
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


def row_of(fault: Fault, outcomes: Sequence[FaultOutcome]) -> FaultRow:
    """Figures of a fault."""

    def latest(event: str) -> float:
        times = [one.first[event] for one in outcomes if event in one.first]
        return max(times, default=float("nan"))

    missed = dict.fromkeys(why for one in outcomes for why in misses(fault, one))
    said = [one.words for one in outcomes if one.words]
    return FaultRow(
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


@dataclass(frozen=True, slots=True)
class Times:
    """When an event followed a fault [s]; infinite where it did not often enough."""

    fault: str
    event: str
    n: int
    p50: float
    p99: float
    p99_9: float


def times_of(faults: Sequence[Fault], outcomes: Sequence[FaultOutcome]) -> list[Times]:
    """Times of the events that each fault is to lead to."""
    found = []
    for fault in faults:
        some = [one for one in outcomes if one.fault == fault.name]
        found += [_times(fault.name, event, some) for event in EVENTS if event in fault.by]
    return found


def vanish_times(vanished: Sequence[Vanished]) -> list[Times]:
    """Times of phones that vanish at many moments."""
    name = "phone vanishes, at any moment"
    outcomes = [
        FaultOutcome(
            name, 0, {"COAST": one.coast_s, "RAMP": one.ramp_s}, 0.0, 0.0, 0, False, 0.0, ""
        )
        for one in vanished
    ]
    return [_times(name, event, outcomes) for event in ("COAST", "RAMP")]


def live_times(faults: Sequence[LiveFault], outcomes: Sequence[LiveOutcome]) -> list[Times]:
    """When somebody coasted and ramped, where that is asked, thrust fell for good, and was none."""
    found = []
    for fault in faults:
        some = [one for one in outcomes if one.fault == fault.name]
        if fault.coast_s is not None:
            found.append(_quantiles(fault.name, "COAST", [one.coasts_s for one in some]))
        if fault.ramp_s is not None:
            found.append(_quantiles(fault.name, "RAMP", [one.ramps_s for one in some]))
        found.append(_quantiles(fault.name, "falls", [one.falls_s for one in some]))
        found.append(_quantiles(fault.name, "zero", [one.zero_s for one in some]))
    return found


def live_goals(faults: Sequence[LiveFault], times: Sequence[Times]) -> dict[str, bool]:
    """Whether whoever is left acted in time: of these processes, so without slack."""
    at = {(one.fault, one.event): one for one in times}
    held = {}
    for fault in faults:
        for event, within_s in (("COAST", fault.coast_s), ("RAMP", fault.ramp_s)):
            if within_s is not None:
                n, late_s = at[fault.name, event].n, at[fault.name, event].p99_9
                found = f"{event} {late_s:.3f} s p99.9 of {n}, within {within_s:g} s"
                held[f"live: {fault.name}: {found}"] = late_s <= within_s
    return held


def percentile(times: Sequence[float], percent: float) -> float:
    """By when an event had followed so often [s]; NaN of none."""
    return float(np.percentile(times, percent, method="higher")) if times else float("nan")


def _times(fault: str, event: str, outcomes: Sequence[FaultOutcome]) -> Times:
    return _quantiles(fault, event, [one.first.get(event, float("inf")) for one in outcomes])


def _quantiles(fault: str, event: str, times: Sequence[float]) -> Times:
    return Times(fault, event, len(times), *(percentile(times, q) for q in (50.0, 99.0, 99.9)))
