"""Metrics of many runs of one estimator through worlds that differ in their seed only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan

import numpy as np
from scipy.stats import chi2

from hardware.sim.world.evaluator import Errors, EstimatorRun
from hardware.sim.world.world import Flags, World
from pipeline.frames import Array

BAND = (0.025, 0.975)
"""Quantiles between which 95 % of honest filters are."""


@dataclass(frozen=True, slots=True)
class EstimatorMetrics:
    """RMS errors over all times judged of all runs; NaN for what is not known."""

    now_mm: float
    """Distance (3D)."""
    now_deg: float
    captured_mm: float
    """At the time of the last fused picture."""
    captured_deg: float
    held_mm: float
    """Of p seen in the frame of the phone's last sample: what a virtual camera works with."""
    u_mm_s: float
    nees: float
    """Mean of the normalised squared error of (p, θ) now: 6 when honest."""
    in_band_pct: float
    """Ticks at which the mean NEES of the runs is inside its 95 % band."""
    captured_nees: float
    nis: float
    """Per degree of freedom, as the estimator tells it: 1 when honest."""
    known_pct: float
    """Ticks with an estimate."""


def judge(
    tracks: Sequence[EstimatorRun], start: float = 5.0, stop: float = inf
) -> EstimatorMetrics:
    """Metrics of the times start ≤ t < stop [s]."""
    now = [track.now.during(start, stop) for track in tracks]
    captured = [track.captured.during(start, stop) for track in tracks]
    ticks = [(track.now.t >= start) & (track.now.t < stop) for track in tracks]
    nees = np.array([errors.nees() for errors in now])
    now_mm, now_deg = size(_stack(now))
    captured_mm, captured_deg = size(_stack(captured))
    return EstimatorMetrics(
        now_mm=now_mm,
        now_deg=now_deg,
        captured_mm=captured_mm,
        captured_deg=captured_deg,
        held_mm=1e3 * _rms(_chosen([track.held_error for track in tracks], ticks)),
        u_mm_s=1e3 * _rms(_chosen([track.u_error for track in tracks], ticks)),
        nees=_mean(nees.ravel()),
        in_band_pct=100.0 * in_band(nees),
        captured_nees=_mean(np.concatenate([errors.nees() for errors in captured])),
        nis=_mean(np.concatenate([_reported(track, start, stop)[:, 1] for track in tracks])),
        known_pct=100.0 * float(np.isfinite(nees).mean()),
    )


def in_band(nees: Array) -> float:
    """Share of the ticks at which the mean of (runs, ticks) is what honest runs would show."""
    runs = len(nees)
    low, high = chi2.ppf(BAND, 6 * runs) / runs
    mean = nees.mean(axis=0)
    return float(np.mean((mean >= low) & (mean <= high)))


def at_return(track: EstimatorRun, world: World, stop: float) -> Array:
    """(6,) error at the last tick before the first picture taken after `stop` [s] arrives."""
    after = world.t[world.pictures.i] >= stop
    k = int(np.searchsorted(track.now.t, world.pictures.arrival[after][0])) - 1
    error: Array = track.now.e[k]
    return error


def size(e: Array) -> tuple[float, float]:
    """RMS of errors (n, 6): [mm], [°]."""
    return 1e3 * _rms(e[:, :3]), float(np.rad2deg(_rms(e[:, 3:])))


@dataclass(frozen=True, slots=True)
class OffsetMetrics:
    """How well the time offset of the pictures' stamps is known, over many runs."""

    rms_ms: float
    largest_ms: float
    locked_wrong: int
    """Runs that end more than 2 ms and 5 σ off: wrong, and sure of it."""


def judge_offset(
    tracks: Sequence[EstimatorRun], offsets: Sequence[float], start: float
) -> OffsetMetrics:
    """What is told from `start` [s] on, against the true `offsets` [s]; NaN if nothing is."""
    errors, wrong = [], 0
    for track, offset in zip(tracks, offsets, strict=True):
        reported = _reported(track, start, inf)[:, 2:] - (offset, 0.0)
        errors.append(reported[:, 0])
        wrong += bool(len(reported) and abs(reported[-1, 0]) > max(2e-3, 5.0 * reported[-1, 1]))
    e = np.concatenate(errors)
    known = e[np.isfinite(e)]
    if not len(known):
        return OffsetMetrics(nan, nan, wrong)
    rms = float(np.sqrt(np.mean(known**2)))
    return OffsetMetrics(1e3 * rms, 1e3 * float(np.abs(known).max()), wrong)


def _reported(track: EstimatorRun, start: float, stop: float) -> Array:
    t = track.health[:, 0]
    reported: Array = track.health[(t >= start) & (t < stop)]
    return reported


def _stack(errors: Sequence[Errors]) -> Array:
    return np.concatenate([e.e for e in errors])


def _chosen(rows: Sequence[Array], ticks: Sequence[Flags]) -> Array:
    return np.concatenate([row[chosen] for row, chosen in zip(rows, ticks, strict=True)])


def _rms(e: Array) -> float:
    """RMS length of the rows that are known."""
    known = e[np.isfinite(e).all(axis=1)]
    return float(np.sqrt(np.square(known).sum(axis=1).mean())) if len(known) else nan


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else nan
