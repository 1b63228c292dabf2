"""Figures of flights with gaps: pure functions of their logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.config import PERIOD_S
from pipeline.frames import Array
from pipeline.signals import AT_REST, Mode
from server.experiments.gaps.flight import Case, FlightLog

WINDOW_TICKS: Final = 20
"""0.1 s: over which the reference's speed is taken; an estimate's noise of a millimetre is then
0.01 m/s."""
RELEASE_S: Final = 1.0
"""After a gap, in which the reference's speed counts as that of its release."""
ENDED: Final = (Mode.RAMP, *AT_REST)
WAITING: Final = (Mode.COAST, Mode.HOLD)


@dataclass(frozen=True)
class FlightFigures:
    """Figures of one flight; NaN where nothing of the kind happened."""

    follows_pct: float
    """Of the time since the take-off: TRACK."""
    ended: int
    """Flights that went to RAMP, or to zero."""
    resumed: int
    """COAST to TRACK: back by itself."""
    pressed: int
    """HOLD to TRACK: by a new press."""
    coasts: int
    holds: int
    ramps: int
    excursion_mm: float
    """Farthest from where the robot should be (`FlightLog.due_in_f`)."""
    behind_mm: float
    """Farthest from where an ideal virtual camera has it that sees the hand through gaps."""
    drift_mm: float
    """Farthest from where the robot was when a gap was noticed, while it lasts."""
    release_m_s: float
    """Fastest reference beyond the ideal's own motion, over 0.1 s, in the second after a gap."""
    quiet_m_s: float
    """The same where nothing is released, p99: the estimate's noise."""
    step_mm: float
    """From the robot to the reference, as that is taken up again after a gap: 0 if it did not move
    meanwhile but with the robot."""
    reasons: tuple[str, ...]
    """Of each mode but TRACK that was entered."""


def flight_of(log: FlightLog) -> FlightFigures:
    """Figures of a log."""
    modes = np.array(log.mode, dtype=int)
    before, after = modes[:-1], modes[1:]

    def entered(*wanted: Mode) -> int:
        return int(np.sum(np.isin(after, wanted) & ~np.isin(before, wanted)))

    def changed(one: Mode, other: Mode) -> int:
        return int(np.sum((before == one) & (after == other)))

    body, ideal = np.array(log.body_in_f), np.array(log.ideal_in_f)
    reference, due = np.array(log.reference_in_f), np.array(log.due_in_f)
    flying = ~np.isin(modes, (*ENDED, Mode.ARMED))
    away = np.linalg.norm(body - due, axis=1)[flying]
    behind = np.linalg.norm(body - ideal, axis=1)[np.isin(modes, (Mode.TRACK, Mode.COAST))]
    released, quiet = _speeds(modes, reference - ideal)
    return FlightFigures(
        follows_pct=100.0 * float(np.mean(modes == Mode.TRACK)),
        ended=entered(*ENDED),
        resumed=changed(Mode.COAST, Mode.TRACK),
        pressed=changed(Mode.HOLD, Mode.TRACK),
        coasts=entered(Mode.COAST),
        holds=entered(Mode.HOLD),
        ramps=entered(Mode.RAMP),
        excursion_mm=1e3 * float(away.max(initial=0.0)),
        drift_mm=1e3 * _largest(_drifts(modes, body, WAITING)),
        behind_mm=1e3 * float(behind.max(initial=0.0)),
        release_m_s=_largest(released),
        quiet_m_s=float(np.percentile(quiet, 99.0)) if len(quiet) else float("nan"),
        step_mm=1e3 * _largest(_steps(modes, reference - body)),
        reasons=tuple(sorted(set(log.reasons))),
    )


def spans(flags: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """[from, to) of each run of true `flags` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def _drifts(modes: Array, places: Array, wanted: tuple[Mode, ...]) -> list[float]:
    """How far each run of `wanted` modes leads from its first place [m]."""
    runs = (places[begin:end] for begin, end in spans(np.isin(modes, wanted)))
    known = (run[np.isfinite(run).all(axis=1)] for run in runs)
    return [float(np.linalg.norm(run - run[0], axis=1).max()) for run in known if len(run)]


def _steps(modes: Array, away: Array) -> list[float]:
    """How far the reference was `away` (n, 3) from the robot where tracking was resumed [m]."""
    resumed = np.flatnonzero((modes[:-1] == Mode.COAST) & (modes[1:] == Mode.TRACK)) + 1
    return np.linalg.norm(away[resumed], axis=1).tolist() if len(resumed) else []


def _speeds(modes: Array, beyond: Array) -> tuple[list[float], list[float]]:
    """Speeds [m/s] of the reference `beyond` the ideal (n, 3): in releases, and elsewhere."""
    released: list[float] = []
    quiet: list[float] = []
    length = round(RELEASE_S / PERIOD_S)
    for begin, end in spans(modes == Mode.TRACK):
        run = beyond[begin:end]
        steps = np.linalg.norm(run[WINDOW_TICKS:] - run[:-WINDOW_TICKS], axis=1)
        speeds = (steps[np.isfinite(steps)] / (WINDOW_TICKS * PERIOD_S)).tolist()
        follows_gap = begin > 0 and modes[begin - 1] in WAITING
        released += speeds[: length - WINDOW_TICKS] if follows_gap else []
        quiet += speeds[length:] if follows_gap else speeds
    return released, quiet


def _largest(values: Sequence[float]) -> float:
    return max(values, default=float("nan"))


@dataclass(frozen=True)
class GapHeading:
    """What was flown."""

    link: str
    gap_ms: float
    every_s: float
    way: str


@dataclass(frozen=True)
class GapRow(FlightFigures, GapHeading):
    """All seeds of a case: the mean of what it follows, sums of counts, else the worst."""

    seeds: int


COUNTS: Final = ("ended", "resumed", "pressed", "coasts", "holds", "ramps")
SIZES: Final = ("excursion_mm", "behind_mm", "drift_mm", "release_m_s", "quiet_m_s", "step_mm")


def row_of(case: Case, flights: Sequence[FlightFigures]) -> GapRow:
    """Figures of a case."""
    counts = {name: sum(getattr(one, name) for one in flights) for name in COUNTS}
    known = {name: [one for one in map(attrgetter(name), flights) if one == one] for name in SIZES}
    shared: dict[str, Any] = counts | {name: _largest(ones) for name, ones in known.items()}
    return GapRow(
        link=case.minute or f"{case.side}'s link",
        gap_ms=1e3 * case.gap_s if not case.minute else float("nan"),
        every_s=case.every_s if not case.minute else float("nan"),
        way=case.way,
        follows_pct=float(np.mean([one.follows_pct for one in flights])),
        seeds=len(flights),
        reasons=tuple(sorted({reason for one in flights for reason in one.reasons})),
        **shared,
    )
