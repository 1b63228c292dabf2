"""The command: fly each gap and each recorded minute by each way; print, write JSON, draw."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hardware.robot_file import BY_GAINS, RobotFile, load_robot
from pipeline.config import TeleopConfig, VirtualCameraConfig
from server.common.ranges import number, whole
from server.common.text import Column, dashed
from server.control.process import teleop_config
from server.experiments import processes
from server.experiments.gaps import picture, vanish
from server.experiments.gaps.flight import Case, FlightLog, fly
from server.experiments.gaps.goals import goals
from server.experiments.gaps.measure import FlightFigures, GapRow, flight_of, row_of
from server.experiments.gaps.traces import MINUTE_S, minutes
from server.experiments.runner import ExperimentReport, experiment

GAPS_MS: Final = (40.0, 90.0, 160.0, 250.0, 400.0, 700.0, 1000.0)
USUAL_S: Final = 5.0
EVERY_S: Final = (2.0, 5.0, 10.0)
SHORT_MS: Final = (160.0, 250.0, 400.0)
"""Flown more and less often than usual, too."""
ROBOT_MS: Final = 250.0
"""The longest gap in the robot's link."""
SHOWN: Final = Case("phone", "webrtc", 0.25, 5.0)
"""Of which a flight is drawn."""
COLUMNS: Final[tuple[Column, ...]] = (
    ("link", "link", "{}"),
    ("gap_ms", "gap ms", "{:.0f}"),
    ("every_s", "every s", "{:.0f}"),
    ("way", "way", "{}"),
    ("follows_pct", "follows %", "{:.1f}"),
    ("ended", "ended", "{}"),
    ("resumed", "resumed", "{}"),
    ("pressed", "pressed", "{}"),
    ("coasts", "COAST", "{}"),
    ("holds", "HOLD", "{}"),
    ("ramps", "RAMP", "{}"),
    ("excursion_mm", "excursion mm", "{:.1f}"),
    ("drift_mm", "drift mm", "{:.1f}"),
    ("behind_mm", "behind mm", "{:.1f}"),
    ("release_m_s", "release m/s", "{:.3f}"),
    ("quiet_m_s", "else m/s", "{:.3f}"),
    ("step_mm", "step mm", "{:.2f}"),
)


@dataclass(frozen=True, slots=True)
class GapJob:
    """One flight."""

    robot_file: RobotFile
    config: TeleopConfig
    case: Case
    seed: int
    seconds: float


def flown(job: GapJob) -> tuple[GapJob, FlightFigures, FlightLog | None]:
    """Figures of a flight, and its log if it is to be drawn."""
    log = fly(job.robot_file, job.config, job.case, job.seed, job.seconds)
    return job, flight_of(log), log if job.case == SHOWN and job.seed == 1 else None


def cases(arguments: argparse.Namespace) -> Iterator[Case]:
    """What is flown, in the order of the table."""
    for every_s in arguments.every_s:
        for gap_ms in arguments.gap_ms:
            if every_s != USUAL_S and gap_ms not in SHORT_MS:
                continue
            yield Case("phone", "webrtc", 1e-3 * gap_ms, every_s)
            yield Case("phone", "websocket", 1e-3 * gap_ms, every_s)
            if gap_ms <= ROBOT_MS:
                yield Case("robot", "udp", 1e-3 * gap_ms, every_s)
    if not arguments.no_traces:
        yield from (Case("phone", "radio", minute=minute.name) for minute in minutes())


@experiment("gaps")
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Fly each gap and each recorded minute by each way."""
    if arguments.quick:
        arguments.seeds, arguments.seconds = 1, min(arguments.seconds, 20.0)
        arguments.gap_ms, arguments.every_s = [160.0, 250.0, 400.0], [5.0]
        arguments.vanish = min(arguments.vanish, 40)
    robot_file = load_robot(arguments.robot, takes=BY_GAINS)
    config = teleop_config(robot_file, arguments.gains, VirtualCameraConfig(), "relative")
    jobs = [
        GapJob(robot_file, config, case, seed, MINUTE_S if case.minute else arguments.seconds)
        for case in cases(arguments)
        for seed in range(1, arguments.seeds + 1)
    ]
    rows, log = _rows(jobs, arguments.workers)
    gone = vanish.fly(robot_file, config, arguments.vanish, arguments.workers)
    print(f"{arguments.robot}, gains {arguments.gains}, hand moving, the button held; {_about()}")
    title = f"{1e3 * SHOWN.gap_s:.0f} ms every {SHOWN.every_s:.0f} s, {SHOWN.way}"
    shown = (title, log) if log else None
    return ExperimentReport(
        {"rows": rows, "vanished": gone},
        dashed(COLUMNS, rows),
        goals(rows, gone),
        draw=lambda folder: (picture.draw(rows, shown, folder / "gaps.png"),),
    )


def _about() -> str:
    recorded = (f"{m.name}: {m.gaps} gaps, longest {m.longest_s:.2f} s" for m in minutes())
    return (
        "counts are sums over the seeds, distances and speeds the worst; recorded minutes:\n  "
        + "\n  ".join(recorded)
    )


def _rows(jobs: list[GapJob], workers: int) -> tuple[list[GapRow], FlightLog | None]:
    """A row a case in the order of the jobs, and the flight to be drawn."""
    found: dict[tuple[Case, int], FlightFigures] = {}
    shown = None
    for job, flight, log in processes.each(flown, jobs, workers):
        found[job.case, job.seed] = flight
        shown = log or shown
        print(f"flown: {job.case}, seed {job.seed}", file=sys.stderr, flush=True)
    ordered = dict.fromkeys(job.case for job in jobs)
    by_seed = sorted(found, key=lambda one: one[1])  # the same whatever the workers
    rows = [row_of(case, [found[one] for one in by_seed if one[0] == case]) for case in ordered]
    return rows, shown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
    parser.add_argument("--seeds", type=whole(1, 1000), default=2, help="flights of each kind")
    parser.add_argument("--seconds", type=number(5.0, 600.0), default=60.0, help="of each flight")
    parser.add_argument("--gap-ms", nargs="+", type=number(0.0, 5000.0), default=list(GAPS_MS))
    parser.add_argument("--every-s", nargs="+", type=number(0.5, 60.0), default=list(EVERY_S))
    parser.add_argument("--no-traces", action="store_true", help="no recorded minutes")
    parser.add_argument(
        "--vanish", type=whole(0, 100_000), default=1000, help="phones that vanish for good"
    )
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--gains", default="phone", help="a gain set of the robot file")
    parser.add_argument("--workers", type=whole(1, 256), default=processes.cores())
    parser.add_argument(
        "--quick", action="store_true", help="three gaps, traces, 40 vanishing phones; one seed"
    )
