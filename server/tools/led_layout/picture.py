"""Heat maps of margins and uncertainty over the directions a robot is seen from."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hardware.led_layout.margins import FAR_PX
from hardware.led_layout.viewpoints import attitude, direction, seen
from pipeline.frames import Array
from server.media.plots import pyplot
from server.tools.led_layout.report import GOOD_PX, MERGED_PX, LayoutReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

WIDE, PAD = 4, 0.25
DECADE = 10.0
"""Colours span what is enough times and by this."""


@dataclass(frozen=True, slots=True, eq=False)
class _Map:
    title: str
    unit: str
    values: Array
    """(k,) per view."""
    enough: float | None = None
    """From here on green; None: less is better."""
    worst: Array | None = None
    """(2,) angles of the worst view of all, between those drawn too [rad]."""
    least: float = np.inf
    """What it is there."""


def draw(layouts: list[LayoutReport], path: Path) -> Path:
    """Two rows of maps per layout, all at its usual distance, each with one scale for all."""
    columns = [_maps(it) for it in layouts]
    tall = 2 * len(layouts)
    figure = pyplot().figure(figsize=(4.3 * WIDE, 3.7 * tall + 0.4), layout="constrained")
    parts = figure.subfigures(len(layouts), 1, squeeze=False)[:, 0]
    for part, it, maps in zip(parts, layouts, columns, strict=True):
        part.suptitle(_headline(it), fontsize=12, weight="bold")
        panels = part.subplots(2, WIDE).ravel()
        for k, shown in enumerate(maps):
            same = np.concatenate([others[k].values for others in columns])
            _draw_map(part, panels[k], it, shown, same)
        _draw_leds(panels[-1], it)
    figure.savefig(path, dpi=100)
    pyplot().close(figure)
    return path


def _headline(it: LayoutReport) -> str:
    return (
        f"{it.name}: {it.grade} at {it.looks.distances[it.usual]:.2f} m,"
        f" f {it.looks.focal_px:.0f} px, {len(it.looks.angles)} views"
        f" (× worst; σ: one coordinate of a spot off by {it.noise_px:g} px)"
    )


def _maps(it: LayoutReport) -> list[_Map]:
    d = it.usual
    gravity = degrees(it.looks.gravity_rad)
    four, every = "margin, any four LEDs,\n", f"margin, all {len(it.leds_in_b)} LEDs,\n"
    return [
        _margin(it, f"{four}nothing else known", 0, 0),
        _margin(it, f"{four}gravity known to {gravity:.0f}°", 0, 1),
        _margin(it, f"{every}nothing else known", 1, 0),
        _Map("two nearest spots apart", "px", it.margins.apart[:, d], MERGED_PX),
        _Map("σ across the line of sight", "mm", 1e3 * it.sigmas.lateral[:, d]),
        _Map("σ of depth", "mm", 1e3 * it.sigmas.depth[:, d]),
        _Map("σ of rotation, worst axis", "°", np.degrees(it.sigmas.rotation[:, d])),
    ]


def _margin(it: LayoutReport, title: str, size: int, known: int) -> _Map:
    d = it.usual
    values, found = it.margins.wrong[:, d, size, known], it.worst.get((d, size, known))
    worst = it.looks.angles[int(values.argmin())] if found is None else found.angles
    return _Map(title, "px", values, GOOD_PX, worst, it.least(d, size, known))


def _draw_map(figure: Figure, axis: Axes, it: LayoutReport, shown: _Map, same: Array) -> None:
    """Each view colours what is nearest to it; `same` are the values that share its scale."""
    x, y = np.degrees(it.looks.angles).T
    (left, right), (bottom, top) = np.degrees(it.looks.window)
    grid_x, grid_y = np.meshgrid(np.linspace(left, right, 120), np.linspace(bottom, top, 80))
    narrower = np.cos(np.radians(grid_y))[..., None]  # near the poles a step of azimuth is short
    squares = (narrower * (grid_x[..., None] - x)) ** 2 + (grid_y[..., None] - y) ** 2
    field = shown.values[np.argmin(squares, axis=-1)]
    colours, norm, beyond = _scale(shown, same)
    mesh = axis.pcolormesh(grid_x, grid_y, field, norm=norm, cmap=colours, shading="nearest")
    bar = figure.colorbar(mesh, ax=axis, shrink=0.9, extend=beyond, label=f"[{shown.unit}]")
    if shown.enough is not None:
        ticks = shown.enough * np.array([0.1, 0.3, 1.0, 3.0, 10.0])
        bar.set_ticks(ticks.tolist(), labels=[f"{tick:g}" for tick in ticks])
        bar.minorticks_off()
    worst = shown.worst
    if worst is not None and shown.least < FAR_PX:
        axis.plot(*np.degrees(worst), "x", color="black", ms=9, mew=2, clip_on=False)
    least = min(shown.least, float(shown.values.min()))
    side = f"least {least:.2f}" if shown.enough else f"most {shown.values.max():.2f}"
    axis.set_title(f"{shown.title}: {side} {shown.unit}", fontsize=10)
    axis.set_xlabel("camera's azimuth [°]  (0 behind, + left)")
    axis.set_ylabel("elevation [°]")


def _scale(shown: _Map, same: Array) -> tuple[str, Normalize, str]:
    """Colours, how they are spread, and at which ends values may lie beyond."""
    from matplotlib.colors import LogNorm, Normalize

    if shown.enough is None:
        return "viridis_r", Normalize(float(same.min()), float(same.max())), "neither"
    return "RdYlGn", LogNorm(shown.enough / DECADE, shown.enough * DECADE, clip=True), "both"


def _draw_leds(axis: Axes, it: LayoutReport) -> None:
    """As the picture shows them from the middle of the views."""
    middle = np.mean(np.array(it.looks.window), axis=1)
    distance = float(it.looks.distances[it.usual])
    px = seen(it.leds_in_b, attitude(direction(middle)), distance, it.looks.focal_px)
    axis.plot(*px.T, "o", ms=9, color="tab:orange")
    for k, (u, v) in enumerate(px):
        axis.annotate(str(k + 1), (u, v), xytext=(7, 5), textcoords="offset points")
    centre = 0.5 * (px.min(axis=0) + px.max(axis=0))
    half = (0.5 + PAD) * float(np.ptp(px, axis=0).max())
    axis.set_xlim(centre[0] - half, centre[0] + half)
    axis.set_ylim(centre[1] + half, centre[1] - half)
    axis.set_aspect("equal")
    axis.grid(True, alpha=0.4)
    azimuth, elevation = np.degrees(middle)
    where = f"from azimuth {azimuth:.0f}°, elevation {elevation:.0f}°"
    axis.set_title(f"the LEDs as the camera sees them\n{where}", fontsize=10)
    axis.set_xlabel("right of the picture's middle [px]")
    axis.set_ylabel("below it [px]")
