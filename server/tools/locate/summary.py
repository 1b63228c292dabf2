"""What a run came to, as a table."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.vision.visual_front_end import VisualFrontEnd
from server.tools.locate.history import History

LABEL = 15
"""Letters of the first column."""


def summary(history: History) -> str:
    """Lines for who ran it: found, how well, what it cost, why not."""
    n, found = len(history), int(history.found.sum())
    first, last = history.times[0], history.times[-1]
    lines = [
        _line("frames", f"{n}, from {first:.3f} to {last:.3f} s"),
        _line("found", f"{found} ({100.0 * found / n:.1f} %)"),
    ]
    if history.unreadable:
        lines.append(_line("unreadable", str(history.unreadable)))
    if found:
        lines += _quality(history)
    lines += ["", *_costs(history)]
    if history.reasons:
        lines += ["", "not found, because", *_reasons(history.reasons)]
    return "\n".join(lines)


def camera_lines(camera: Camera, front_end: VisualFrontEnd) -> list[str]:
    """What pictures and gyroscopes together say of the camera; nothing without enough motion."""
    facts = front_end.monitor.facts
    if facts is None:
        return []
    used = "" if front_end.camera.readout_s == camera.readout_s else ", corrected while it ran"
    lines = [
        "",
        "the camera, as pictures and gyroscopes have it",
        _line("  dates", _measured(1e3 * facts.offset_s, 1e3 * facts.offset_sigma_s, "ms"))
        + " later than t_s says",
        _line("  readout", _measured(1e3 * facts.readout_s, 1e3 * facts.readout_sigma_s, "ms"))
        + f" (in the file: {1e3 * camera.readout_s:.1f} ms{used})",
        _line("  focal", _measured(100.0 * facts.focal, 100.0 * facts.focal_sigma, "%"))
        + " longer than in the file",
    ]
    complaint = front_end.monitor.complaint
    return [*lines, f"  {complaint}"] if complaint else lines


def _measured(value: float, sigma: float, unit: str) -> str:
    return f"{value:+.1f} ± {sigma:.1f} {unit}"


def _quality(history: History) -> list[str]:
    counts = Counter(history.leds)
    leds = ", ".join(f"{many} in {counts[many]}" for many in sorted(counts, reverse=True))
    px = np.array(history.reprojections_px)
    C = history.covariances[history.found]
    variances = np.diagonal(C, axis1=1, axis2=2)
    across, ahead = np.sqrt(variances[:, :2].max(axis=1)), np.sqrt(variances[:, 2])
    turn = np.rad2deg(np.sqrt(variances[:, 3:].max(axis=1)))
    return [
        _line("LEDs", f"{leds} frames"),
        _line("reprojection", f"{_spread(px, '.2f', 'px')}"),
        _line("σ across", f"{_spread(1e3 * across, '.2f', 'mm')}"),
        _line("σ in depth", f"{_spread(1e3 * ahead, '.2f', 'mm')}"),
        _line("σ of rotation", f"{_spread(turn, '.3f', '°')}"),
    ]


def _spread(values: Array, form: str, unit: str) -> str:
    median, high = np.quantile(values, (0.5, 0.95))
    return f"{median:{form}} {unit} in the median, {high:{form}} {unit} in the worst 5 %"


def _costs(history: History) -> list[str]:
    lines = [f"{'CPU a frame [ms]':<{LABEL + 2}}{'median':>8}{'p99':>9}{'worst':>9}"]
    for stage, seconds in history.took_s.items():
        ms = 1e3 * np.array(seconds)
        figures = (float(np.median(ms)), float(np.quantile(ms, 0.99)), float(ms.max()))
        cells = "".join(f"{figure:>9.3f}" for figure in figures)
        lines.append(f"  {stage:<{LABEL - 1}}{cells}")
    return lines


def _reasons(reasons: Sequence[str]) -> list[str]:
    """Counted, the commonest first; those that differ in their numbers only are one."""
    groups: dict[str, Counter[str]] = {}
    for reason in reasons:
        groups.setdefault(re.sub(r"\d+(\.\d+)?", "…", reason), Counter())[reason] += 1
    ordered = sorted(groups.items(), key=lambda group: -group[1].total())
    return [
        f"{texts.total():>6}  {next(iter(texts)) if len(texts) == 1 else pattern}"
        for pattern, texts in ordered
    ]


def _line(label: str, text: str) -> str:
    return f"{label:<{LABEL}}{text}"
