"""Draws what gaps cost: how much of the time it follows, how far it strays, and one flight."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.signals import Mode
from server.experiments.drawing import panels, save
from server.experiments.gaps.flight import FlightLog
from server.experiments.gaps.goals import EXCURSION_MM, FOLLOWS_PCT
from server.experiments.gaps.measure import GapRow, spans

if TYPE_CHECKING:  # loaded only when something is drawn
    from matplotlib.axes import Axes

COLOURS = {"webrtc": "C0", "websocket": "C1", "udp": "C2", "radio": "C4"}
SHADES = {Mode.COAST: "0.85", Mode.HOLD: "C1", Mode.RAMP: "C3"}
SHOWN_S = 12.0


def draw(rows: Sequence[GapRow], shown: tuple[str, FlightLog] | None, path: Path) -> Path:
    """A figure; gives its file."""
    figure, ((follows, strays), (traces, flight)) = panels(2, 2, figsize=(12.0, 8.0))
    kinds = list(dict.fromkeys((r.link, r.way, r.every_s) for r in rows if r.way != "radio"))
    for link, way, every_s in kinds:
        ones = sorted(
            (r for r in rows if (r.link, r.way, r.every_s) == (link, way, every_s)),
            key=lambda r: r.gap_ms,
        )
        x = [r.gap_ms for r in ones]
        style = {"color": COLOURS[way], "marker": ".", "alpha": min(1.0, 0.3 + every_s / 12.0)}
        label = f"{link}, {way}, every {every_s:g} s"
        follows.plot(x, [r.follows_pct for r in ones], label=label, **style)
        strays.plot(x, [r.excursion_mm for r in ones], **style)
    follows.plot(list(FOLLOWS_PCT), list(FOLLOWS_PCT.values()), "k_", ms=14, label="goal")
    follows.set(xlabel="gap [ms]", ylabel="follows [% of the time]")
    strays.axhline(EXCURSION_MM, color="k", lw=0.8, ls=":")
    strays.set(xlabel="gap [ms]", ylabel="excursion [mm]")
    if kinds:
        follows.legend(fontsize=6)
    recorded = [r for r in rows if r.way == "radio"]
    y = np.arange(len(recorded))
    traces.barh(y, [r.follows_pct for r in recorded], color=COLOURS["radio"])
    traces.set(yticks=y, yticklabels=[r.link for r in recorded], xlabel="follows [% of the time]")
    traces.axvline(97.0, color="k", lw=0.8, ls=":")
    if shown is not None:
        _flight(flight, *shown)
    return save(figure, path)


def _flight(axis: Axes, title: str, log: FlightLog) -> None:
    """Where the robot was and should have been, along y; the modes shaded."""
    t = np.array(log.t) - log.t[0]
    end = int(np.searchsorted(t, SHOWN_S))
    modes = np.array(log.mode, dtype=int)[:end]
    for mode, shade in SHADES.items():
        for begin, until in spans(modes == mode):
            axis.axvspan(t[begin], t[until - 1], color=shade, alpha=0.4, lw=0.0)
    for name, places, style in (
        ("ideal", log.ideal_in_f, "k:"),
        ("due", log.due_in_f, "C0--"),
        ("robot", log.body_in_f, "C3-"),
    ):
        axis.plot(t[:end], 1e3 * np.array(places)[:end, 1], style, lw=0.9, label=name)
    axis.set(title=title, xlabel="time [s]", ylabel="along y [mm]")
    axis.legend(fontsize=7)
