"""Figures of a flight in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.config import PERIOD_S
from pipeline.frames import Array
from server.simulation.trace import TrackingTrace
from server.simulation.virtual_time import SimulationOptions

SETTLE_S = 2.0
"""After the press, before tracking counts: the integral must first learn the spring."""


@dataclass(frozen=True, slots=True)
class TrackingFigures:
    """Figures of one flight; lengths in mm, angles in degrees."""

    around: str
    """Scene in which it was flown; "": LEDs before an empty wall."""
    hand: str
    seed: int
    tracked_s: float
    rms_mm: float
    """Of the body's distance from the intended place."""
    max_mm: float
    rms_deg: float
    estimate_rms_mm: float
    chatter_n: float
    """RMS change of a thrust from one period to the next."""
    saturated_pct: float
    found_pct: float
    """Pictures in which the robot was found."""
    cpu_s: float
    ended: str
    """Why tracking ended early, or ""."""


def result_of(
    trace: TrackingTrace, scene: SimulationOptions, cpu_s: float, settle_s: float = SETTLE_S
) -> TrackingFigures:
    """Figures of a trace, without the first seconds of tracking."""
    skip = round(settle_s / PERIOD_S)
    errors = rows_of(trace.error_in_f)[skip:]
    distance = np.linalg.norm(errors, axis=1)
    steps = np.diff(rows_of(trace.thrusts)[skip:], axis=0)
    return TrackingFigures(
        around=scene.around.name if scene.around is not None else "",
        hand=scene.hand,
        seed=scene.seed,
        tracked_s=round(PERIOD_S * len(errors), 2),
        rms_mm=1e3 * rms(distance),
        max_mm=1e3 * float(distance.max(initial=0.0)),
        rms_deg=float(np.rad2deg(rms(np.linalg.norm(rows_of(trace.turn)[skip:], axis=1)))),
        estimate_rms_mm=1e3
        * rms(np.linalg.norm(rows_of(trace.estimate_error_in_c)[skip:], axis=1)),
        chatter_n=rms(steps.ravel()),
        saturated_pct=100.0 * float(np.mean(trace.saturated[skip:] or [False])),
        found_pct=100.0 * trace.poses / max(1, trace.pictures),
        cpu_s=cpu_s,
        ended=trace.left,
    )


def rows_of(values: Sequence[Array]) -> Array:
    """Rows as one array, (0, 3) where there are none."""
    return np.array(values) if values else np.zeros((0, 3))


def rms(values: Array) -> float:
    """Root of the mean square; NaN of none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
