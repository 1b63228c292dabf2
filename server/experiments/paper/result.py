"""What an experiment gives: figures, statements that hold or not, pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from server.common.text import statements
from server.experiments.paper.setup.measure import ComparedFigure, table_of


@dataclass(frozen=True, slots=True, eq=False)
class PaperResult:
    """Result of one of the paper's experiments."""

    name: str
    """Of its file."""
    title: str
    cells: tuple[ComparedFigure, ...]
    holds: Mapping[str, bool]
    """Statements of the paper, and whether they hold here."""
    draw: Callable[[Path], list[Path]]
    """Draws the paper's figures into a folder; gives the files."""

    def text(self) -> str:
        """Title, table, statements."""
        return "\n".join((self.title, table_of(self.cells), *statements(self.holds)))

    def json(self) -> dict[str, object]:
        """Values for programs; null is what could not be measured."""
        rows = [{**asdict(cell), "ratio": cell.ratio} for cell in self.cells]
        return {"title": self.title, "cells": rows, "holds": dict(self.holds)}
