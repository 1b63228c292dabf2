"""Table III: how long two people take to bring the laser through the tube, EKF on and off.

A seed is one such study: the same two people, five attempts with each flavour of the controller,
one beginning without the EKF, the other with it; what they have learnt they keep.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from math import nan
from pathlib import Path
from typing import Final

import numpy as np

from server.common.progress import progress_bar
from server.common.text import Column, dashed, statements
from server.experiments.paper.picture import figure_beam, figure_times
from server.experiments.paper.setup import published
from server.experiments.paper.setup.measure import ExperimentSetup
from server.experiments.paper.setup.task import PEOPLE, Attempt
from server.experiments.paper.setup.trials import Trial, flown, trials_of
from server.experiments.paper.setup.variants import WITH_EKF, WITHOUT_EKF, Variant

NAME: Final = "table_3"
TITLE: Final = (
    f"Table III: mean time [s] to hold the laser {published.HELD_S:g} s through the tube; "
    f"{published.LIMIT_S:g} s where it failed"
)


@dataclass(frozen=True, slots=True)
class ComparedTime:
    """A mean time of the table."""

    operator: str
    variant: str
    paper: float
    """[s]; NaN: not in the paper."""
    ours: float
    """[s]."""
    error: float
    """Standard error of `ours` [s]."""
    median: float
    """[s]."""
    done: int
    attempts: int
    through_pct: float
    """Of the time flown, the beam went through."""

    @property
    def ratio(self) -> float:
        """Ours in units of the paper's."""
        return self.ours / self.paper

    @property
    def successes(self) -> str:
        """Out of all."""
        return f"{self.done}/{self.attempts}"


COLUMNS: Final[tuple[Column, ...]] = (
    ("operator", "operator", "{}"),
    ("variant", "", "{}"),
    ("paper", "paper", "{:.2f}"),
    ("ours", "ours", "{:.2f}"),
    ("ratio", "ratio", "{:.2f}"),
    ("error", "±", "{:.2f}"),
    ("median", "median", "{:.2f}"),
    ("successes", "successes", "{}"),
    ("through_pct", "through %", "{:.0f}"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """The experiment's result."""

    flown: tuple[tuple[Trial, Attempt], ...]
    name: str = NAME

    @property
    def cells(self) -> list[ComparedTime]:
        """One for each person and variant."""
        variants = dict.fromkeys(trial.variant for trial, _ in self.flown)
        return [self._cell(person.name, variant) for person in PEOPLE for variant in variants]

    def _cell(self, operator: str, variant: str) -> ComparedTime:
        ones = [a for t, a in self.flown if (t.name, t.variant) == (operator, variant)]
        seconds = np.array([one.seconds for one in ones])
        return ComparedTime(
            operator,
            variant,
            paper=published.TABLE_III.get(variant, {}).get(operator, nan),
            ours=float(np.mean(seconds)),
            error=float(np.std(seconds, ddof=1) / np.sqrt(len(ones))) if len(ones) > 1 else nan,
            median=float(np.median(seconds)),
            done=sum(one.done for one in ones),
            attempts=len(ones),
            through_pct=100.0 * float(np.mean(np.concatenate([a.clearance for a in ones]) >= 0.0)),
        )

    @property
    def holds(self) -> dict[str, bool]:
        """What the paper's table says, whether it holds here."""
        ours = {(cell.operator, cell.variant): cell.ours for cell in self.cells}
        return {
            f"operator {person.name}: faster with the EKF": ours[person.name, WITH_EKF.name]
            < ours[person.name, WITHOUT_EKF.name]
            for person in PEOPLE
        }

    def text(self) -> str:
        """Title, table, statements."""
        lost = (
            f"ended: operator {trial.name}, {trial.variant}, attempt {trial.number}, "
            f"seed {trial.seed}: {one.ended}"
            for trial, one in self.flown
            if one.ended
        )
        return "\n".join((TITLE, dashed(COLUMNS, self.cells), *lost, *statements(self.holds)))

    def json(self) -> dict[str, object]:
        """Values for programs; null is what the paper has not."""
        cells = [{**asdict(cell), "ratio": cell.ratio} for cell in self.cells]
        attempts = [
            {
                "operator": trial.name,
                "variant": trial.variant,
                "number": trial.number,
                "seed": trial.seed,
                "seconds": one.seconds,
                "done": one.done,
                "ended": one.ended,
            }
            for trial, one in self.flown
        ]
        return {"title": TITLE, "cells": cells, "attempts": attempts, "holds": self.holds}

    def draw(self, folder: Path) -> list[Path]:
        """Times of all attempts; the beam in one of each kind."""
        times = [
            (trial.name, trial.variant, trial.number, one.seconds) for trial, one in self.flown
        ]
        shown = {
            (trial.name, trial.variant): one
            for trial, one in reversed(self.flown)
            if trial.repetition == published.REPETITIONS
        }
        return [
            figure_times(times, folder / "table_3.png"),
            figure_beam(shown, folder / "table_3_beam.png"),
        ]


def measure(setup: ExperimentSetup, extra: Sequence[Variant] = ()) -> Study:
    """Fly all attempts with each variant; the paper's two columns and `extra` ones."""
    trials = list(trials_of(setup, (WITHOUT_EKF, WITH_EKF, *extra)))
    results: dict[int, Attempt] = {}
    with (
        progress_bar(len(trials), "attempts") as bar,
        closing(flown(trials, setup.workers)) as coming,
    ):
        for k, one in coming:
            results[k] = one
            bar.update()
    return Study(tuple((trial, results[k]) for k, trial in enumerate(trials)))
