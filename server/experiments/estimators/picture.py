"""Error over time with what each estimator believed of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hardware.sim.world.evaluator import EstimatorRun
from pipeline.frames import Array
from server.experiments.drawing import panels, save


def draw(tracks: Mapping[str, EstimatorRun], path: Path) -> Path:
    """A row per estimator, a column per component of the position, ±3 σ as a band."""
    figure, axes = panels(
        len(tracks), 3, figsize=(15.0, 2.8 * len(tracks)), sharex=True, squeeze=False
    )
    for row, (name, track) in zip(axes, tracks.items(), strict=True):
        errors = track.now
        sigma = np.sqrt(errors.C.reshape(-1, 36)[:, (0, 7, 14)])
        for k, (axis, letter) in enumerate(zip(row, "xyz", strict=True)):
            mm, band = 1e3 * errors.e[:, k], 3e3 * sigma[:, k]
            axis.fill_between(errors.t, -band, band, color=f"C{k}", alpha=0.2, lw=0.0)
            axis.plot(errors.t, mm, color=f"C{k}", lw=0.7)
            axis.set_title(f"{name}: {letter} in c, ±3 σ")
            limit = max(_nearly_all(1.2 * np.abs(mm)), _nearly_all(1.05 * band))
            axis.set_ylim(-limit, limit)
        row[0].set_ylabel("error [mm]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return save(figure, path)


def _nearly_all(values: Array) -> float:
    """98 % of the known ones are below it."""
    known = values[np.isfinite(values)]
    return float(np.quantile(known, 0.98)) if len(known) else 1.0
