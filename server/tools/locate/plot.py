"""Poses over time with their standard deviations."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.frames import Array
from server.media.plots import pyplot
from server.tools.locate.history import History

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = (
    "x, right [m]",
    "y, down [m]",
    "z, forward [m]",
    "about x [°]",
    "about y [°]",
    "about z [°]",
)
MARKED = 400
"""More frames are lines without dots."""


def draw(history: History, path: Path, title: str) -> None:
    """Position, and rotation since the first pose, in o; ±3 σ as a band, red where not found."""
    figure = pyplot().figure(figsize=(11.0, 10.0), layout="constrained")
    axes = figure.subplots(6, 1, sharex=True)
    times, found = np.array(history.times), history.found
    values = np.column_stack((history.positions, np.rad2deg(history.turns)))
    sigmas = np.sqrt(np.diagonal(history.covariances, axis1=1, axis2=2))
    sigmas[:, 3:] = np.rad2deg(sigmas[:, 3:])
    for k, axis in enumerate(axes):
        style = ".-" if len(times) <= MARKED else "-"
        band = 3.0 * sigmas[:, k]
        axis.fill_between(
            times, values[:, k] - band, values[:, k] + band, color=f"C{k % 3}", alpha=0.3, lw=0.0
        )
        axis.plot(times, values[:, k], style, color=f"C{k % 3}", lw=0.8, ms=3.0)
        axis.set_ylabel(TITLES[k])
        axis.grid(alpha=0.3)
        _mark_lost(axis, times, found)
    axes[0].set_title(title)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=110, format=path.name.removesuffix(".part").rsplit(".", 1)[-1].lower())
    pyplot().close(figure)


def _mark_lost(axis: Axes, times: Array, found: np.typing.NDArray[np.bool_]) -> None:
    """A red stripe over each run of frames without a pose, half a frame to each side."""
    half = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.5
    edges = np.flatnonzero(np.diff(np.concatenate(([True], found, [True])).astype(np.int8)))
    for first, stop in edges.reshape(-1, 2):
        axis.axvspan(times[first] - half, times[stop - 1] + half, color="red", alpha=0.12, lw=0.0)
