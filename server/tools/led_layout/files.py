"""What `lightleash robot leds` found, as TOML to paste, as JSON and on disk."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import degrees, isfinite
from pathlib import Path

import numpy as np

from hardware.led_layout.margins import KNOWN
from pipeline.frames import Array
from server.media.plots import drawn
from server.tools.led_layout.picture import draw
from server.tools.led_layout.report import LayoutReport


class OutError(ValueError):
    """A folder that can't be written to; says why."""


def make_folder(folder: Path) -> None:
    """Before long work, so that its results have a place.

    Raises:
        OutError: it can't be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutError(f"--out: {folder}: no folder can be made: {error.strerror}") from error


@dataclass(frozen=True, slots=True)
class Change:
    """A figure before and after."""

    what: str
    before: float
    after: float


def changes(before: LayoutReport, after: LayoutReport) -> list[Change]:
    """What an improvement improved, at the usual distance."""
    d = before.usual
    pairs: list[tuple[str, Callable[[LayoutReport], float]]] = [
        ("four named, gravity known: smallest margin [px]", lambda it: it.least(d, 0, 1)),
        ("four named, attitude known [px]", lambda it: it.least(d, 0, 2)),
        ("all named, nothing known [px]", lambda it: it.least(d, 1, 0)),
        ("second pose of all LEDs [px]", lambda it: float(it.margins.other[:, d, 1].min())),
        ("nearest spots [px]", lambda it: float(it.margins.apart[:, d].min())),
        ("σ across, worst view [mm]", lambda it: 1e3 * float(it.sigmas.lateral[:, d].max())),
        ("σ of depth, worst view [mm]", lambda it: 1e3 * float(it.sigmas.depth[:, d].max())),
        ("σ of rotation, worst view [°]", lambda it: degrees(np.max(it.sigmas.rotation[:, d]))),
    ]
    return [Change(what, figure(before), figure(after)) for what, figure in pairs]


def toml(leds_in_b: Array) -> Iterator[str]:
    """[[leds]] as a robot file has them."""
    for led in leds_in_b:
        yield "[[leds]]"
        yield f"position_in_body_m = [{', '.join(f'{x:.4g}' for x in np.round(led, 4) + 0.0)}]"


def figures(it: LayoutReport) -> dict[str, object]:
    """Figures as JSON can hold them: finite numbers or null."""
    by_distance = []
    for d, distance in enumerate(it.looks.distances):
        row: dict[str, object] = {"distance_m": float(distance)}
        for size, named in enumerate(("four", "all")):
            for k, known in enumerate(KNOWN):
                row[f"margin_{named}_{known}_px"] = it.least(d, size, k)
                row[f"share_below_3px_{named}_{known}"] = it.below(d, size, k)
            second = float(it.margins.other[:, d, size].min())
            row[f"second_pose_{named}_px"] = second if isfinite(second) else None
        row["apart_px"] = float(it.margins.apart[:, d].min())
        for part in ("lateral", "depth", "rotation"):
            unit, seen = ("rad" if part == "rotation" else "m"), getattr(it.sigmas, part)[:, d]
            row[f"sigma_{part}_median_{unit}"] = float(np.median(seen))
            row[f"sigma_{part}_worst_{unit}"] = float(seen.max())
            row[f"sigma_{part}_one_hidden_{unit}"] = float(getattr(it.hidden, part)[:, d].max())
        by_distance.append(row)
    return {
        "name": it.name,
        "grade": it.grade,
        "leds_in_b_m": it.leds_in_b.tolist(),
        "views": len(it.looks.angles),
        "focal_px": it.looks.focal_px,
        "noise_px": it.noise_px,
        "distances": by_distance,
    }


def write(layouts: list[LayoutReport], folder: Path) -> None:
    """Picture, figures and, when there is a better layout, [[leds]] to paste.

    Raises:
        OutError: the disk refuses.
    """
    files = {"leds.json": json.dumps([figures(it) for it in layouts], indent=1)}
    if len(layouts) > 1:
        files["leds_improved.toml"] = "\n".join(toml(layouts[-1].leds_in_b))
    try:
        pictures = drawn(lambda: [draw(layouts, folder / "leds.png")])
        for name, text in files.items():
            (folder / name).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise OutError(f"--out: {folder}: {error.strerror}") from error
    names = [*(path.name for path in pictures), *files]
    print(f"wrote {', '.join(names)} in {folder}", file=sys.stderr)
