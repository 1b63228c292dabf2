"""Panels to draw on, and their file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from server.media.plots import pyplot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def panels(
    rows: int = 1,
    columns: int = 1,
    *,
    figsize: tuple[float, float],
    sharex: bool | Literal["col"] = False,
    sharey: bool = False,
    squeeze: bool = True,
    width_ratios: tuple[float, ...] | None = None,
) -> tuple[Figure, Any]:
    """A figure with its axes, as `pyplot.subplots` gives them.

    Raises:
        NoPlotsError: matplotlib is not there.
    """
    figure, axes = pyplot().subplots(
        rows,
        columns,
        figsize=figsize,
        sharex=sharex,
        sharey=sharey,
        squeeze=squeeze,
        width_ratios=width_ratios,
    )
    return figure, axes


def save(figure: Figure, path: Path) -> Path:
    """Write it, in a folder that may have to be made, and close it."""
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    pyplot().close(figure)
    return path
