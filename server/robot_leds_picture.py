"""Heat maps of margins and uncertainty over the directions a robot is seen from."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hardware.led_looks import attitude, direction, seen
from pipeline.frames import Array
from server.robot_leds_report import GOOD_PX, MERGED_PX, Judged

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDE, PAD_PX = 4, 30.0


@dataclass(frozen=True, slots=True, eq=False)
class _Map:
    title: str
    values: Array
    """(k,) per view."""
    enough: float | None = None
    """From here on green; None: less is better."""


def draw(layouts: list[Judged], path: Path) -> None:
    """Two rows of maps per layout, all at its usual distance, each with one scale for all."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    columns = [_maps(it) for it in layouts]
    figure, axes = pyplot.subplots(
        2 * len(layouts), WIDE, figsize=(3.9 * WIDE, 6.6 * len(layouts)), squeeze=False
    )
    for row, it in enumerate(layouts):
        panels = axes[2 * row : 2 * row + 2].ravel()
        for k, shown in enumerate(columns[row]):
            same = np.concatenate([maps[k].values for maps in columns])
            _draw_map(figure, panels[k], it, shown, float(same.min()), float(same.max()))
        _draw_leds(panels[-1], it)
        for panel in panels[::WIDE]:
            panel.set_ylabel(f"{it.name}\nelevation [°]")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def _maps(it: Judged) -> list[_Map]:
    d, wrong = it.usual, it.margins.wrong
    gravity = degrees(it.looks.gravity_rad)
    noise = f"at {it.noise_px:g} px"
    return [
        _Map("margin [px]: four named, nothing known", wrong[:, d, 0, 0], GOOD_PX),
        _Map(f"margin [px]: four named, gravity to {gravity:.0f}°", wrong[:, d, 0, 1], GOOD_PX),
        _Map("margin [px]: all named, nothing known", wrong[:, d, 1, 0], GOOD_PX),
        _Map("nearest spots apart [px]", it.margins.apart[:, d], MERGED_PX),
        _Map(f"σ across [mm] {noise}", 1e3 * it.sigmas.lateral[:, d]),
        _Map(f"σ of depth [mm] {noise}", 1e3 * it.sigmas.depth[:, d]),
        _Map(f"σ of rotation [°] {noise}", np.degrees(it.sigmas.rotation[:, d])),
    ]


def _draw_map(figure: Figure, axis: Axes, it: Judged, shown: _Map, low: float, high: float) -> None:
    """Each view colours what is nearest to it."""
    from matplotlib.colors import Normalize, TwoSlopeNorm

    x, y = np.degrees(it.looks.angles).T
    (left, right), (bottom, top) = np.degrees(it.looks.window)
    grid_x, grid_y = np.meshgrid(np.linspace(left, right, 120), np.linspace(bottom, top, 80))
    narrower = np.cos(np.radians(grid_y))[..., None]  # near the poles a step of azimuth is short
    squares = (narrower * (grid_x[..., None] - x)) ** 2 + (grid_y[..., None] - y) ** 2
    field = shown.values[np.argmin(squares, axis=-1)]
    if shown.enough is None:
        colours, norm = "viridis_r", Normalize(low, high)
    else:
        colours, norm = "RdYlGn", TwoSlopeNorm(shown.enough, 0.0, max(high, 2.0 * shown.enough))
    mesh = axis.pcolormesh(grid_x, grid_y, field, norm=norm, cmap=colours, shading="nearest")
    figure.colorbar(mesh, ax=axis, shrink=0.9)
    axis.set_title(shown.title, fontsize=10)
    axis.set_xlabel("azimuth [°]")


def _draw_leds(axis: Axes, it: Judged) -> None:
    """As the picture shows them from the middle of the views."""
    middle = np.mean(np.array(it.looks.window), axis=1)
    distance = float(it.looks.distances[it.usual])
    px = seen(it.leds_in_b, attitude(direction(middle)), distance, it.looks.focal_px)
    axis.plot(*px.T, "o", ms=9, color="tab:orange")
    for k, (u, v) in enumerate(px):
        axis.annotate(str(k + 1), (u, v), xytext=(7, 5), textcoords="offset points")
    low, high = px.min(axis=0) - PAD_PX, px.max(axis=0) + PAD_PX
    axis.set_xlim(low[0], high[0])
    axis.set_ylim(high[1], low[1])
    axis.set_aspect("equal", adjustable="datalim")
    azimuth, elevation = np.degrees(middle)
    axis.set_title(f"from {azimuth:.0f}°, {elevation:.0f}°, {distance:.2f} m [px]", fontsize=10)
