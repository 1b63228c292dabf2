"""Table IV, Fig. 7 and 8: the camera turned by 3° in 0.3 s about z_c at 2.5 m, VCI on and off."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from pathlib import Path

from server.experiments.paper.picture import figure_7, figure_8
from server.experiments.paper.result import PaperResult
from server.experiments.paper.setup import published
from server.experiments.paper.setup.flight import ExperimentTrace
from server.experiments.paper.setup.measure import ComparedFigure, ExperimentSetup, cell_of
from server.experiments.paper.setup.variants import WITH_VCI, WITHOUT_VCI, Variant

NAME = "table_4"
TITLE = "Table IV, Fig. 7, 8: 3° in 0.3 s about z_c at 2.5 m, RMS in mm and degrees"
HAND = "turn_z"
SECONDS = 9.0
FAR_BELOW = 0.5
"""What "≪" is taken to mean."""


def measure(setup: ExperimentSetup, extra: Sequence[Variant] = ()) -> PaperResult:
    """Fly with each variant; the paper's two columns and `extra` ones."""
    cells: list[ComparedFigure] = []
    shown: dict[str, ExperimentTrace] = {}
    for variant in (WITHOUT_VCI, WITH_VCI, *extra):
        traces = setup.fly(variant, HAND, SECONDS)
        shown[variant.name] = traces[0]
        for axis in ("y", "yaw"):
            paper = published.TABLE_IV.get(variant.name, {}).get(axis, nan)
            cells.append(cell_of(variant.name, axis, paper, traces))
    f_max = setup.robot_file.robot.f_max

    def draw(folder: Path) -> list[Path]:
        return [
            figure_7(shown, folder / "fig_7.png"),
            figure_8(shown, f_max, folder / "fig_8.png"),
        ]

    return PaperResult(NAME, TITLE, tuple(cells), orderings(cells), draw)


def orderings(cells: Sequence[ComparedFigure]) -> dict[str, bool]:
    """What the paper says of table and figures, whether it holds here."""
    rms = {(cell.variant, cell.axis): cell.ours for cell in cells}
    saturated = {cell.variant: cell.saturated_pct for cell in cells}
    holds = {
        f"{axis}: with the VCI far less error": rms["with VCI", axis]
        < FAR_BELOW * rms["without VCI", axis]
        for axis in ("y", "yaw")
    }
    return holds | {
        "without the VCI actuators saturate": saturated["without VCI"] > 0.0,
        "with the VCI none does": saturated["with VCI"] == 0.0,
    }
