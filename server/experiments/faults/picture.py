"""Draws when what followed each fault, and how far the robot strayed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from server.experiments.drawing import panels, save
from server.experiments.faults.measure import EVENTS, FaultRow

MARKS = {"COAST": ("o", "C7"), "HOLD": ("s", "C1"), "RAMP": ("v", "C3"), "robot": ("d", "C4")}
MARKS |= {"zero": ("|", "k")}


def draw(rows: Sequence[FaultRow], path: Path) -> Path:
    """A figure; gives its file."""
    height = 1.5 + 0.2 * len(rows)
    figure, (times, strays) = panels(
        1, 2, figsize=(12.0, height), sharey=True, width_ratios=(3.0, 1.0)
    )
    y = list(range(len(rows)))
    for event in EVENTS:
        mark, colour = MARKS[event]
        label = "robot by itself" if event == "robot" else event
        x = [getattr(row, event) for row in rows]
        times.plot(x, y, mark, color=colour, label=label, ms=6, ls="")
    times.set(xscale="log", xlim=(4e-3, 10.0), xlabel="after the fault, at the latest [s]")
    times.set_yticks(y, [row.fault for row in rows], fontsize=7)
    for label, row in zip(times.get_yticklabels(), rows, strict=True):
        label.set_color("C3" if row.missed else "k")
    times.invert_yaxis()
    times.grid(visible=True, alpha=0.3)
    times.legend(fontsize=7)
    strays.barh(y, [row.excursion_mm for row in rows], color="C0")
    strays.set_xlabel("excursion [mm]")
    return save(figure, path)
