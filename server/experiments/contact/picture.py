"""Force over time, compliant beside stiff: one panel a scene, its band shaded."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from server.experiments.contact.flight import ContactTrace
from server.experiments.contact.measure import ContactRow, smooth
from server.experiments.contact.setting import BAND_N, GO_S, STAY_S
from server.experiments.drawing import save
from server.experiments.paper.picture import TIME, lettered


def draw(shown: Sequence[tuple[ContactRow, ContactTrace]], path: Path) -> Path:
    """A figure; gives its file."""
    scenes = list(dict.fromkeys(row.scene for row, _ in shown))
    figure, axes = lettered(len(scenes))
    for axis, scene in zip(axes, scenes, strict=True):
        ones = [(row, trace) for row, trace in shown if row.scene == scene]
        for k, (row, trace) in enumerate(ones):
            colour = f"C{3 - k}" if k < 4 else f"C{k}"
            if not len(trace.t):
                continue
            axis.plot(trace.t, smooth(trace.force_n), color=colour, lw=1.0, label=row.way)
            if k > 0:
                edges = row.predicted_n - BAND_N, row.predicted_n + BAND_N
                axis.axhspan(*edges, color=colour, alpha=0.15)
        for moment in (GO_S, GO_S + STAY_S):
            axis.axvline(moment, color="k", ls=":", lw=0.8)
        axis.set_title(scene, fontsize="medium")
        axis.set_ylabel("force on it [N]")
        axis.legend(loc="upper right", fontsize="small")
    axes[-1].set_xlabel(TIME)
    return save(figure, path)
