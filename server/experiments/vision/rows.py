"""Records as rows of figures, for tables, files and verdicts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pipeline.frames import Array
from pipeline.vision.vision import STAGES
from server.common.text import table
from server.experiments.vision.errors import MEDIAN_CHI2_6, Error
from server.experiments.vision.watch import SceneRecord

NAN = float("nan")
COLUMNS = (
    ("scene", "scene", "{}"),
    ("height", "rows", "{}"),
    ("channel", "channel", "{}"),
    ("solvable", "solvable", "{}"),
    ("found_percent", "found %", "{:.1f}"),
    ("fresh_percent", "from 0 %", "{:.0f}"),
    ("wrong", "wrong", "{}"),
    ("lateral_mm", "lat. mm", "{:.3f}"),
    ("depth_mm", "dep. mm", "{:.2f}"),
    ("turn_deg", "rot. °", "{:.3f}"),
    ("lateral_p95_mm", "p95", "{:.2f}"),
    ("depth_p95_mm", "p95", "{:.2f}"),
    ("turn_p95_deg", "p95", "{:.3f}"),
    ("nees", "NEES/6", "{:.2f}"),
    ("nees_p95", "p95", "{:.1f}"),
    ("effective_px", "eff. px", "{:.3f}"),
    ("to_bound", "× bound", "{:.1f}"),
    ("tracking_ms", "ms", "{:.2f}"),
    ("tracking_p99_ms", "p99", "{:.2f}"),
    ("starting_ms", "from 0 ms", "{:.1f}"),
    ("starting_p95_ms", "p95", "{:.1f}"),
    ("worst_ms", "worst", "{:.1f}"),
)


@dataclass(frozen=True, slots=True)
class VisionRow:
    """Figures of one record; NaN where there is nothing to tell."""

    scene: str
    width: int
    height: int
    channel: str
    frames: int
    """Looked at, from nothing included."""
    solvable: int
    found: int
    found_percent: float
    fresh_percent: float
    """Of those who start from nothing, within three pictures."""
    wrong: int
    undecoded: int
    lateral_mm: float
    """Medians, unless the name says otherwise."""
    depth_mm: float
    turn_deg: float
    lateral_p95_mm: float
    depth_p95_mm: float
    turn_p95_deg: float
    nees: float
    """Over 6; 0.89 if the claimed covariance is true."""
    nees_p95: float
    """2.1 then."""
    effective_px: float
    """Pixel noise that would explain the pose errors."""
    to_bound: float
    """Error by the Cramér-Rao bound's."""
    bound_lateral_mm: float
    """Root mean squares at the bound."""
    bound_depth_mm: float
    bound_turn_deg: float
    return_worst: float
    """Pictures until found again."""
    returns: int
    tracking_ms: float
    """CPU time of all stages while tracking."""
    tracking_p99_ms: float
    stages_ms: dict[str, float]
    """Medians while tracking."""
    starting_ms: float
    """From nothing."""
    starting_p95_ms: float
    worst_ms: float
    """Of all pictures."""
    whole_p99_ms: float
    """With all that is learnt of the camera."""
    blobs: float
    """When starting."""
    pass_ms: float
    wrong_at: list[tuple[int, int]]
    """(seed, picture); −1 − picture if tried from nothing."""


def row(record: SceneRecord) -> VisionRow:
    """The figures of a record."""
    tracking, starting = _sums(record.tracking_s), _sums(record.starting_s)
    return VisionRow(
        scene=record.scene,
        width=record.size[0],
        height=record.size[1],
        channel=record.channel,
        frames=record.frames + record.fresh_frames,
        solvable=record.solvable,
        found=record.found,
        found_percent=_percent(record.found, record.solvable),
        fresh_percent=_percent(record.fresh_found, record.fresh),
        wrong=record.wrong,
        undecoded=record.undecoded,
        **_accuracy(record.errors),
        return_worst=float(max(record.returns, default=NAN)),
        returns=len(record.returns),
        tracking_ms=_at(tracking, 50),
        tracking_p99_ms=_at(tracking, 99),
        stages_ms=_stages(record),
        starting_ms=_at(starting, 50),
        starting_p95_ms=_at(starting, 95),
        worst_ms=_at(np.concatenate((tracking, starting)), 100),
        whole_p99_ms=_at(1e3 * np.array(record.whole_s), 99),
        blobs=_at(np.array(record.blobs, dtype=np.float64), 50),
        pass_ms=_at(1e3 * np.array(record.pass_s), 50),
        wrong_at=record.wrong_at,
    )


def _accuracy(errors: list[Error]) -> dict[str, float]:
    lateral = 1e3 * _all(errors, "lateral_m")
    depth = 1e3 * _all(errors, "depth_m")
    turn = np.rad2deg(_all(errors, "turn_rad"))
    return {
        "lateral_mm": _at(lateral, 50),
        "depth_mm": _at(depth, 50),
        "turn_deg": _at(turn, 50),
        "lateral_p95_mm": _at(lateral, 95),
        "depth_p95_mm": _at(depth, 95),
        "turn_p95_deg": _at(turn, 95),
        "nees": _at(_all(errors, "nees") / 6.0, 50),
        "nees_p95": _at(_all(errors, "nees") / 6.0, 95),
        "effective_px": _at(np.sqrt(_all(errors, "pixel2") / MEDIAN_CHI2_6), 50),
        "to_bound": _at(np.sqrt(_all(errors, "bound2") / MEDIAN_CHI2_6), 50),
        "bound_lateral_mm": 1e3 * _at(_all(errors, "bound_lateral_m"), 50),
        "bound_depth_mm": 1e3 * _at(_all(errors, "bound_depth_m"), 50),
        "bound_turn_deg": float(np.rad2deg(_at(_all(errors, "bound_turn_rad"), 50))),
    }


def _stages(record: SceneRecord) -> dict[str, float]:
    times = 1e3 * np.array(record.tracking_s).reshape(-1, len(STAGES))
    return {name: _at(times[:, k], 50) for k, name in enumerate(STAGES)}


def _all(errors: list[Error], name: str) -> Array:
    values = np.array([getattr(error, name) for error in errors], dtype=np.float64)
    finite: Array = values[np.isfinite(values)]
    return finite


def _sums(times_s: list[tuple[float, float, float]]) -> Array:
    """All stages together [ms]."""
    sums: Array = 1e3 * np.array(times_s).reshape(-1, len(STAGES)).sum(axis=1)
    return sums


def _at(values: Array, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else NAN


def _percent(part: int, whole: int) -> float:
    return 100.0 * part / whole if whole else NAN


def text(rows: list[VisionRow]) -> str:
    """A table."""
    return table(COLUMNS, rows)


def plain_values(rows: list[VisionRow]) -> list[dict[str, Any]]:
    """Replace NaN, which JSON does not have."""
    return [
        {k: None if isinstance(v, float) and v != v else v for k, v in asdict(one).items()}
        for one in rows
    ]
