"""The bench as one picture: found, exact, honest, fast."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from server.experiments.vision.rows import VisionRow
from server.experiments.vision.verdicts import NEES
from server.media.plots import pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Figures = tuple[str, Callable[[VisionRow], float], bool, tuple[float, ...]]
PANELS: tuple[Figures, ...] = (
    ("found of solvable [%]", lambda r: r.found_percent, False, (95.0, 99.0)),
    ("effective pixel noise [px]", lambda r: r.effective_px, True, ()),
    ("NEES/6, median", lambda r: r.nees, True, NEES),
    ("CPU while tracking [ms], median", lambda r: r.tracking_ms, True, (0.3,)),
)


def draw(rows: list[VisionRow], path: Path) -> Path:
    """Scenes side by side, a mark for each size and channel."""
    scenes = list(dict.fromkeys(row.scene for row in rows))
    channels = list(dict.fromkeys(row.channel for row in rows if row.frames))
    figure = pyplot().figure(figsize=(14.0, 3.0 * len(PANELS)), layout="constrained")
    axes = figure.subplots(len(PANELS), 1, sharex=True, squeeze=False)[:, 0]
    for panel, axis in zip(PANELS, axes, strict=True):
        _panel(axis, panel, rows, scenes, channels)
    axes[-1].set_xticks(range(len(scenes)), scenes, rotation=35, ha="right")
    axes[0].legend(ncols=len(channels), fontsize="small", loc="lower left")
    figure.savefig(path, dpi=90)
    pyplot().close(figure)
    return path


def _panel(
    axis: Axes, panel: Figures, rows: list[VisionRow], scenes: list[str], channels: list[str]
) -> None:
    title, figure_of, is_log, lines = panel
    for k, channel in enumerate(channels):
        known = [row for row in rows if row.channel == channel and isfinite(figure_of(row))]
        shown = [row for row in known if not is_log or figure_of(row) > 0.0]
        shift = 0.7 * ((k + 0.5) / len(channels) - 0.5)
        places = [scenes.index(row.scene) + shift for row in shown]
        axis.plot(places, [figure_of(row) for row in shown], ".", label=channel)
    for line in lines:
        axis.axhline(line, color="grey", linewidth=0.8)
    if is_log:
        axis.set_yscale("log")
    axis.set_ylabel(title)
    axis.grid(axis="y", alpha=0.3)
