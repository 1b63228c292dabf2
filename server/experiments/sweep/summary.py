"""What a sweep found, key by key: how each value of it went, whatever the others were."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isnan

import numpy as np

from server.common import text
from server.experiments.sweep.sweep_file import Sweep
from server.simulation.session import SessionOutcome
from server.simulation.sweep_keys import Value


@dataclass(frozen=True, slots=True)
class SweepRow:
    """One value of one key."""

    key: str
    value: str
    sessions: int
    ended: int
    """Of them, whose tracking ended early or never began."""
    low_mm: float
    """The best tenth of the others are better than this."""
    median_mm: float
    high_mm: float


COLUMNS = (
    ("key", "key", "{}"),
    ("value", "value", "{}"),
    ("sessions", "sessions", "{}"),
    ("ended", "ended early", "{}"),
    ("low_mm", "10 % mm", "{:.2f}"),
    ("median_mm", "median mm", "{:.2f}"),
    ("high_mm", "90 % mm", "{:.2f}"),
)


def rows(sweep: Sweep, done: Mapping[int, SessionOutcome]) -> Iterator[SweepRow]:
    """A row for each value; one for all if nothing varies but the seed."""
    if not sweep.varied:
        yield _row("all", "", list(done.values()))
    for key in sweep.varied:
        for value, outcomes in by_value(sweep, done, key).items():
            yield _row(key, worded(value), outcomes)


def by_value(
    sweep: Sweep, done: Mapping[int, SessionOutcome], key: str
) -> dict[Value, list[SessionOutcome]]:
    """Outcomes for each value of a varied key, in the order of the file."""
    found: dict[Value, list[SessionOutcome]] = {}
    for index in sorted(done):
        found.setdefault(dict(sweep.point_of(index))[key], []).append(done[index])
    return found


def went_well(outcome: SessionOutcome) -> bool:
    """Whether its RMS is that of a whole session."""
    return not outcome.figures.ended and not isnan(outcome.figures.rms_mm)


def worded(value: Value) -> str:
    """Words as on an axis."""
    if isinstance(value, tuple):
        return " ".join(f"{one:g}" for one in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _row(key: str, value: str, outcomes: list[SessionOutcome]) -> SweepRow:
    good = [one.figures.rms_mm for one in outcomes if went_well(one)]
    low, middle, high = np.quantile(good or [np.nan], (0.1, 0.5, 0.9)).tolist()
    return SweepRow(key, value, len(outcomes), len(outcomes) - len(good), low, middle, high)


def table(sweep: Sweep, done: Mapping[int, SessionOutcome]) -> str:
    """Table as printed, with the best combination below."""
    printed = text.table(COLUMNS, rows(sweep, done))
    points: dict[int, list[SessionOutcome]] = {}
    for index, outcome in done.items():
        points.setdefault(index // len(sweep.seeds), []).append(outcome)
    whole = {
        point: float(np.median([one.figures.rms_mm for one in outcomes]))
        for point, outcomes in points.items()
        if all(map(went_well, outcomes))
    }
    if not sweep.varied or not whole:
        return printed
    best = min(whole, key=lambda point: whole[point])
    settings = ", ".join(f"{key} {worded(value)}" for key, value in sweep.points[best])
    return f"{printed}\nbest: {settings}: median {whole[best]:.2f} mm"
