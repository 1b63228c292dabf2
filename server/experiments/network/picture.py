"""Draws how old pictures and records were on each line, by each path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from server.experiments.drawing import panels, save
from server.experiments.network.figures import Times
from server.experiments.network.run import Run

COLOURS = {"webrtc": "C0", "websocket": "C1"}
COLUMNS = 5  # of panels
AGES_MS = (1.0, 3e3)


def draw(runs: Sequence[tuple[str, str, Run]], path: Path) -> Path:
    """A panel for each scenario: the share of pictures, and of time, older than an age."""
    names = list(dict.fromkeys(scenario for scenario, _, _ in runs))
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure, axes = panels(
        rows, columns, figsize=(3.2 * columns, 2.9 * rows), squeeze=False, sharex=True, sharey=True
    )
    for panel in axes.flat[len(names) :]:
        panel.axis("off")
    for scenario, way, run in runs:
        panel = axes.flat[names.index(scenario)]
        frames = run.frames.within(run.begin, run.end).ages
        records = run.records.ages_of_newest(run.begin, run.end)
        panel.loglog(*_older(frames), color=COLOURS[way], lw=1.2, label=f"{way}, pictures")
        panel.loglog(
            *_older(records), color=COLOURS[way], lw=1.0, ls="--", label=f"{way}, newest record"
        )
        panel.set(title=scenario, xlim=AGES_MS, ylim=(1e-3, 1.1))
        panel.grid(visible=True, alpha=0.3)
    for panel in axes[-1]:
        panel.set_xlabel("age, ms")
    for panel in axes[:, 0]:
        panel.set_ylabel("share that is older")
    axes[0][0].legend(fontsize=6, loc="lower left")
    return save(figure, path)


def _older(ages: Times) -> tuple[Times, Times]:
    """(age [ms], share that is older)."""
    values = np.sort(1e3 * ages[np.isfinite(ages)])
    return values, 1.0 - np.arange(1, len(values) + 1) / (len(values) + 1.0)
