"""Table I and Fig. 6: the camera moved by 3 cm in 0.3 s along each axis, EKF on and off."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from pathlib import Path

from server.experiments.paper.picture import figure_6
from server.experiments.paper.result import PaperResult
from server.experiments.paper.setup import published
from server.experiments.paper.setup.flight import ExperimentTrace, Move
from server.experiments.paper.setup.measure import ComparedFigure, ExperimentSetup, cell_of
from server.experiments.paper.setup.variants import WITH_EKF, WITHOUT_EKF, Variant

NAME = "table_1"
TITLE = "Table I, Fig. 6: 3 cm in 0.3 s along each axis, RMS in mm"
SECONDS = 4.0  # after each step


def measure(setup: ExperimentSetup, extra: Sequence[Variant] = ()) -> PaperResult:
    """Fly every axis with each variant; the paper's two columns and `extra` ones."""
    cells: list[ComparedFigure] = []
    shown: dict[str, ExperimentTrace] = {}
    for variant in (WITHOUT_EKF, WITH_EKF, *extra):
        flown = setup.fly_each(variant, [Move(f"step_{axis}") for axis in "xyz"], SECONDS)
        for axis, traces in zip("xyz", flown, strict=True):
            paper = published.TABLE_I.get(variant.name, {}).get(axis, nan)
            cells.append(cell_of(variant.name, axis, paper, traces))
            if axis == "x":
                shown[variant.name] = traces[0]

    def draw(folder: Path) -> list[Path]:
        return [figure_6(shown, folder / "fig_6.png")]

    return PaperResult(NAME, TITLE, tuple(cells), orderings(cells), draw)


def orderings(cells: Sequence[ComparedFigure]) -> dict[str, bool]:
    """What the paper's table says, whether it holds here."""
    rms = {(cell.variant, cell.axis): cell.ours for cell in cells}
    return {
        f"{axis}: the EKF lowers the error": rms["with EKF", axis] < rms["without EKF", axis]
        for axis in "xyz"
    }
