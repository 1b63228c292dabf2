"""Each key's effect on the tracking error, with the scatter of the seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from server.experiments.drawing import panels, save
from server.experiments.sweep.summary import by_value, went_well, worded
from server.experiments.sweep.sweep_file import Sweep
from server.simulation.session import SessionOutcome
from server.simulation.sweep_keys import Value

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS: Final = 3
MOST_COLOURS: Final = 7
"""Values of another key that are told apart; more are one cloud."""
WIDE_RANGE: Final = 8.0
"""Largest error over the smallest, above which the axis is logarithmic."""
SPREAD: Final = 0.32
"""How far from its value a point may stand, for those that would cover each other."""


def draw(sweep: Sweep, done: Mapping[int, SessionOutcome], path: Path) -> Path:
    """A panel a key; colours are the values of the key after it; what ended early stands on top."""
    keys = sweep.varied or ("",)
    columns = min(COLUMNS, len(keys))
    shape = ceil(len(keys) / columns), columns
    size = (max(7.0, 5.2 * shape[1]), 4.2 * shape[0])
    figure, axes = panels(*shape, figsize=size, squeeze=False, sharey=True)
    for k, key in enumerate(keys):
        other = keys[(k + 1) % len(keys)] if len(keys) > 1 else ""
        _panel(axes.flat[k], sweep, done, key, other)
    for axis in axes.flat[len(keys) :]:
        axis.set_visible(False)
    errors = [one.figures.rms_mm for one in done.values() if went_well(one)]
    if errors and max(errors) > WIDE_RANGE * min(errors):
        _logarithmic(axes.flat[0])
    for row in axes:
        row[0].set_ylabel("tracking error, RMS [mm]")
    bad = sum(not went_well(one) for one in done.values())
    early = f", {bad} ended early (crosses on top)" if bad else ""
    lines = "lines: medians" if sweep.varied else "line: median"
    figure.suptitle(f"{len(done)} sessions of {sweep.seconds:g} s{early}; points: seeds, {lines}")
    return save(figure, path)


def _panel(
    axis: Axes, sweep: Sweep, done: Mapping[int, SessionOutcome], key: str, other: str
) -> None:
    if not key:
        _series(axis, [0.0], [list(done.values())], 0, 1, "")
        axis.set_xticks([0.0], ["all"])
        return
    found = by_value(sweep, done, key)
    groups = by_value(sweep, done, other) if other else {}
    if not 1 < len(groups) <= MOST_COLOURS:
        groups = {"": list(done.values())}
    for j, (value, members) in enumerate(groups.items()):
        mine = {one.index for one in members}
        kept = [[one for one in outcomes if one.index in mine] for outcomes in found.values()]
        label = f"{_brief(other)} {worded(value)}" if len(groups) > 1 else ""
        _series(axis, list(range(len(found))), kept, j, len(groups), label)
    _name_values(axis, key, list(found))
    if len(groups) > 1:
        axis.legend(fontsize="small")


def _series(
    axis: Axes,
    places: Sequence[float],
    outcomes: Sequence[Sequence[SessionOutcome]],
    j: int,
    of: int,
    label: str,
) -> None:
    """Points, medians and crosses of one colour, beside those of the others."""
    aside = SPREAD * ((j + 0.5) / of - 0.5) * 2.0
    width = SPREAD / of
    medians = []
    for place, members in zip(places, outcomes, strict=True):
        good = [one.figures.rms_mm for one in members if went_well(one)]
        at = place + aside
        spread = at + width * 0.8 * np.linspace(-1.0, 1.0, len(good) + 2)[1:-1]
        axis.plot(spread, good, ".", color=f"C{j}", alpha=0.5, ms=8.0, mew=0.0)
        bad = len(members) - len(good)
        if bad:
            top = axis.get_xaxis_transform()
            axis.plot([at], [0.97], "x", color=f"C{j}", ms=7.0, transform=top, clip_on=False)
            axis.text(
                at, 0.94, f"{bad}", color=f"C{j}", transform=top, ha="center", va="top", size=7
            )
        medians.append((at, float(np.median(good)) if good else np.nan))
    axis.plot(*zip(*medians, strict=True), "o-", color=f"C{j}", lw=1.4, ms=4.5, label=label or None)


def _name_values(axis: Axes, key: str, values: Sequence[Value]) -> None:
    axis.set_xticks(range(len(values)), [worded(value) for value in values])
    if sum(len(worded(value)) for value in values) > 45:
        axis.tick_params(axis="x", labelrotation=45)
    axis.set_xlim(-0.6, len(values) - 0.4)
    axis.set_xlabel(key)
    axis.grid(True, axis="y", which="both", alpha=0.3)


def _brief(key: str) -> str:
    return key.split(".", 1)[-1]


def _logarithmic(axis: Axes) -> None:
    """With plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_yscale("log")
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.yaxis.set_minor_formatter(NullFormatter())
