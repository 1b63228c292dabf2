"""Fig. 9: −4 N along y_b while the robot still follows the slow virtual camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Final

import numpy as np

from pipeline.frames import Array
from server.common.text import Column, flights, statements
from server.experiments.paper.picture import figure_9
from server.experiments.paper.setup import published
from server.experiments.paper.setup.flight import ExperimentTrace, Move, Push
from server.experiments.paper.setup.measure import ExperimentSetup
from server.experiments.paper.setup.variants import WITH_VCI, Variant

NAME: Final = "disturbance"
TITLE: Final = (
    f"Fig. 9: {published.PUSH_N:g} N along y_b at {published.PUSH_AT_S:g} s, after the turn of "
    f"Table IV at {published.MOVE_AT_S:g} s"
)
HAND: Final = "turn_z"
SECONDS: Final = 13.0  # of a flight
PUSH: Final = Push(published.PUSH_AT_S - published.MOVE_AT_S, published.PUSH_N)
SHARE: Final = 0.1
"""Of the peak: back."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """What the push did: the true place with it, less the same flight without."""

    variant: str
    peak_mm: float
    back_s: float
    """From the push until it stays within a tenth of the peak."""
    spread_s: float
    """Standard deviation over the seeds."""
    answer_n: float
    """How much more thrust along y_b control asks for in the end."""
    ended: str
    """Why tracking ended early, if it did."""


COLUMNS: Final[tuple[Column, ...]] = (
    ("variant", "", "{}"),
    ("peak_mm", "peak mm", "{:.1f}"),
    ("back_s", "back within 10 % after s", "{:.2f}"),
    ("spread_s", "±", "{:.2f}"),
    ("answer_n", "answered with N", "{:.2f}"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Pushed:
    """The experiment's result."""

    rows: tuple[Rejection, ...]
    shown: ExperimentTrace
    name: str = NAME

    @property
    def holds(self) -> dict[str, bool]:
        """What Fig. 9 shows, and whether it does here."""
        low, high = published.BACK_S
        back = self.rows[0].back_s
        return {f"back within 10 % after {low:g} to {high:g} s": bool(low <= back <= high)}

    def text(self) -> str:
        """Title, table, statements."""
        return "\n".join((TITLE, flights(COLUMNS, self.rows), *statements(self.holds)))

    def json(self) -> dict[str, object]:
        """Values for programs; null is what could not be measured."""
        rows = list(self.rows)
        return {
            "title": TITLE,
            "paper": {"back_s": published.BACK_S},
            "rows": rows,
            "holds": self.holds,
        }

    def draw(self, folder: Path) -> list[Path]:
        """Fig. 9."""
        return [figure_9(self.shown, folder / "fig_9.png")]


def measure(setup: ExperimentSetup, extra: Sequence[Variant] = ()) -> Pushed:
    """Fly with the push and without; the paper's variant first."""
    rows, shown = [], []
    for variant in (WITH_VCI, *extra):
        pushed, left = setup.fly_each(variant, [Move(HAND, PUSH), Move(HAND)], SECONDS)
        rows.append(rejection(variant.name, pushed, left))
        shown.append(pushed[0])
    flown = (trace for trace in shown if not trace.ended)
    return Pushed(tuple(rows), next(flown, shown[0]))


def rejection(
    name: str, pushed: Sequence[ExperimentTrace], left: Sequence[ExperimentTrace]
) -> Rejection:
    """Figures of flights with the push, against those left alone with the same seeds."""
    ended = next((trace.ended for trace in (*pushed, *left) if trace.ended), "")
    if ended:
        return Rejection(name, nan, nan, nan, nan, ended)
    pairs = list(zip(pushed, left, strict=True))
    moved = [a.missed_in_b[:, 1] - b.missed_in_b[:, 1] for a, b in pairs]
    asked = [a.wrench_in_b[-200:, 1].mean() - b.wrench_in_b[-200:, 1].mean() for a, b in pairs]
    back = [
        back_after(trace.t - PUSH.after_s, away) for trace, away in zip(pushed, moved, strict=True)
    ]
    return Rejection(
        name,
        peak_mm=1e3 * float(np.mean([np.abs(away).max() for away in moved])),
        back_s=float(np.mean(back)),
        spread_s=float(np.std(back)),
        answer_n=float(np.mean(asked)),
        ended="",
    )


def back_after(t: Array, away: Array) -> float:
    """When (n,) `away` last leaves a tenth of its peak, in the time of `t` (n,) [s]."""
    outside = np.flatnonzero(np.abs(away) > SHARE * np.abs(away).max())
    return float(t[outside[-1]]) if len(outside) else 0.0
