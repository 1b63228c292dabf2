"""`lightleash experiments estimators`: three estimators on the same data, against the truth.

Simulated: a hand and a robot known by their statistics, and the posterior Cramér-Rao bound of what
anybody could know. With a recording: what each predicted, against the pose that the picture of
that time gave when it arrived.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, dataclass, replace
from math import inf, nan
from pathlib import Path
from typing import Final, get_args

import numpy as np

from hardware.sim.measured_hands import MEASURED
from hardware.sim.world import evaluator, metrics
from hardware.sim.world.evaluator import EstimatorRun
from hardware.sim.world.metrics import EstimatorMetrics
from hardware.sim.world.pcrb import bound, rms
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.config import EstimatorName, TeleopConfig
from pipeline.estimation.estimator import Estimator
from pipeline.estimation.estimators import make_estimator
from pipeline.frames import Array
from server.common import text
from server.common.ranges import number, seed_number, whole
from server.experiments.estimators.picture import draw
from server.experiments.estimators.recording import play_recording
from server.experiments.runner import ExperimentReport, experiment
from server.recording.reader import read
from server.recording.writer import RecordingError

Tracks = dict[EstimatorName, list[EstimatorRun]]
ESTIMATORS: Final[tuple[EstimatorName, ...]] = get_args(EstimatorName)
UNJUDGED: Final = 0.25
"""Share of a run at its start that does not count: biases are learnt in it."""


@dataclass(frozen=True, slots=True)
class EstimatorRow:
    """One line of the table: `EstimatorMetrics`, and the error in units of the bound's."""

    name: str
    now_mm: float
    now_deg: float
    captured_mm: float = nan
    captured_deg: float = nan
    now_ratio: float = nan
    captured_ratio: float = nan
    held_mm: float = nan
    u_mm_s: float = nan
    nees: float = nan
    in_band_pct: float = nan
    nis: float = nan
    known_pct: float = nan


COLUMNS: Final = (
    ("name", "estimator", "{}"),
    ("now_mm", "now mm", "{:.2f}"),
    ("now_deg", "°", "{:.3f}"),
    ("now_ratio", "÷ bound", "{:.2f}"),
    ("captured_mm", "captured mm", "{:.2f}"),
    ("captured_deg", "°", "{:.3f}"),
    ("captured_ratio", "÷ bound", "{:.2f}"),
    ("held_mm", "held mm", "{:.2f}"),
    ("u_mm_s", "u mm/s", "{:.1f}"),
    ("nees", "NEES", "{:.2f}"),
    ("in_band_pct", "in band %", "{:.0f}"),
    ("nis", "NIS/dof", "{:.2f}"),
    ("known_pct", "known %", "{:.1f}"),
)
LEGEND: Final = (
    "now: when it is asked; captured: at the time of the last picture it fused; held: seen in the "
    "frame of the\nphone's last sample, with which the virtual camera works; NEES: 6 when honest, "
    "NIS/dof: 1"
)


RECORDED: Final = (
    "Predicted for the time of a picture before it came, against the pose it then gave: what all "
    "poses have\nwrong in common is not seen. NEES: 6 when honest, NIS/dof: 1"
)


def estimator_of(name: EstimatorName, leds_in_b: Array) -> Estimator:
    """Estimator with its usual numbers."""
    return make_estimator(replace(TeleopConfig(), estimator=name), leds_in_b)


def row_of(name: str, score: EstimatorMetrics, limit: EstimatorRow | None) -> EstimatorRow:
    """A line of the table; `limit` is the bound's."""
    known = {key: value for key, value in asdict(score).items() if key != "captured_nees"}
    row = EstimatorRow(name, **known)
    if limit is None:
        return row
    return replace(
        row,
        now_ratio=row.now_mm / limit.now_mm,
        captured_ratio=row.captured_mm / limit.captured_mm,
    )


@experiment("estimators")
def run(arguments: argparse.Namespace) -> ExperimentReport | int:
    """Each estimator's figures, beside the bound where data are simulated."""
    try:
        tracks, limit, start = (
            _simulated(arguments) if arguments.recording is None else _recorded(arguments.recording)
        )
    except RecordingError as error:
        print(f"lightleash experiments estimators: {error}", file=sys.stderr)
        return 1
    rows = [row_of(name, metrics.judge(runs, start), limit) for name, runs in tracks.items()]
    rows += [limit] if limit is not None else []
    columns = [column for column in COLUMNS if any(_has_value(row, column[0]) for row in rows)]
    shown: dict[str, EstimatorRun] = {name: runs[0] for name, runs in tracks.items()}
    return ExperimentReport(
        rows,
        f"{text.table(columns, rows)}\n{LEGEND if limit is not None else RECORDED}",
        draw=lambda folder: (draw(shown, folder / "estimators.png"),),
    )


def _has_value(row: EstimatorRow, name: str) -> bool:
    value = getattr(row, name)
    return isinstance(value, str) or bool(np.isfinite(value))


def _simulated(arguments: argparse.Namespace) -> tuple[Tracks, EstimatorRow, float]:
    low, high = (1e-3 * ms for ms in arguments.latency_ms)
    setup = WorldOptions(
        seed=arguments.seed,
        duration=arguments.seconds,
        picture_period=1.0 / arguments.fps,
        picture_delay=(low, high),
        hand=arguments.hand,
        tremor_relaxation=arguments.tremor_relaxation_s,
    )
    print(
        f"{arguments.seeds} × {arguments.seconds:g} s, {arguments.fps:g} pictures/s, "
        f"{1e3 * low:g}-{1e3 * high:g} ms late; the first {UNJUDGED:.0%} not judged"
    )
    start, tracks = (
        UNJUDGED * arguments.seconds,
        {name: list[EstimatorRun]() for name in ESTIMATORS},
    )
    now, captured = [], []
    for k in range(arguments.seeds):
        world = World(replace(setup, seed=arguments.seed + k))
        for name, runs in tracks.items():
            runs.append(evaluator.run(estimator_of(name, LEDS_IN_B), world))
        limit = bound(world, start=start)
        now.append(limit.now)
        captured.append(limit.captured)
        _progress(f"{k + 1} of {arguments.seeds}")
    _progress("")
    best = EstimatorRow("bound", *rms(np.concatenate(now)), *rms(np.concatenate(captured)))
    return tracks, best, start


def _recorded(path: Path) -> tuple[Tracks, None, float]:
    tracks, start = play_recording(read(path), ESTIMATORS, estimator_of)
    return {name: [track] for name, track in tracks.items()}, None, start


def _progress(done: str) -> None:
    if sys.stderr.isatty():
        print(f"\r{done:<20}\r", end="", file=sys.stderr, flush=True)


def _positive(word: str) -> float:
    value = float(word)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{word}: more than 0")
    return value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--seeds", type=whole(1, 1000), default=4, help="so many worlds")
    parser.add_argument("--seed", type=seed_number, default=1000, help="the first one")
    parser.add_argument("--seconds", type=number(0.1, 3600.0), default=20.0)
    parser.add_argument("--latency-ms", nargs=2, type=number(0.0, 400.0), default=(60.0, 120.0))
    parser.add_argument("--fps", type=number(1.0, 240.0), default=30.0)
    parser.add_argument(
        "--hand", choices=tuple(MEASURED), default="", help="as recorded; else one with a tremor"
    )
    parser.add_argument(
        "--tremor-relaxation-s",
        type=_positive,
        default=inf,
        help="in which the hand's tremor forgets its phase (a hand's: 0.1-0.2); inf: sines",
    )
    parser.add_argument("--recording", type=Path, help="an MCAP file instead of the simulation")
    parser.add_argument("--out", type=Path, help="folder for picture and JSON")
