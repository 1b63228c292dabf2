"""The command: let every fault happen to flights of many seeds; print, write JSON, draw."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from hardware.robot_file import BY_GAINS, RobotFile, load_robot
from pipeline.config import TeleopConfig, VirtualCameraConfig
from server.common.ranges import whole
from server.common.text import Column, dashed
from server.control.process import teleop_config
from server.experiments import processes
from server.experiments.faults import live, picture
from server.experiments.faults.catalogue import FAULTS
from server.experiments.faults.fault import Fault, FaultOutcome, suffer
from server.experiments.faults.live import LiveFault, LiveOutcome
from server.experiments.faults.measure import (
    FaultRow,
    live_goals,
    live_times,
    row_of,
    times_of,
    vanish_times,
)
from server.experiments.forked import forked
from server.experiments.gaps import vanish
from server.experiments.gaps.flight import GapFlight
from server.experiments.gaps.vanish import Vanished
from server.experiments.runner import ExperimentReport, RefusedError, experiment

APART_TICKS: Final = 7
"""Between two faults in a flight: each meets another moment of it."""
SHARED: Final = 16
"""Faults that are tried in one flight."""
Named = TypeVar("Named", Fault, LiveFault)
COLUMNS: Final[tuple[Column, ...]] = (
    ("fault", "fault", "{}"),
    ("COAST", "COAST s", "{:.3f}"),
    ("HOLD", "HOLD s", "{:.3f}"),
    ("RAMP", "RAMP s", "{:.3f}"),
    ("robot", "robot s", "{:.3f}"),
    ("zero", "zero s", "{:.2f}"),
    ("follows", "follows", "{}"),
    ("excursion_mm", "excursion mm", "{:.0f}"),
    ("tilt_deg", "tilt °", "{:.1f}"),
    ("after_zero", "after zero", "{}"),
    ("missed", "missed", "{}"),
)

TIMES: Final[tuple[Column, ...]] = (
    ("fault", "fault", "{}"),
    ("event", "event", "{}"),
    ("n", "n", "{}"),
    ("p50", "p50 s", "{:.3f}"),
    ("p99", "p99 s", "{:.3f}"),
    ("p99_9", "p99.9 s", "{:.3f}"),
)


@dataclass(frozen=True, slots=True)
class FaultJob:
    """Some faults in one flight."""

    robot_file: RobotFile
    config: TeleopConfig
    seed: int
    names: tuple[str, ...]


def flown(job: FaultJob) -> list[FaultOutcome]:
    """Fly once; each fault happens to a copy of the flight.

    Raises:
        RuntimeError: it never tracked.
    """
    flight = GapFlight(job.robot_file, job.config, job.seed)
    flight.take_off()
    outcomes = []
    for fault in (fault for fault in FAULTS if fault.name in job.names):
        for _ in range(APART_TICKS):
            flight.advance()
        outcomes.append(forked(partial(suffer, flight, fault, job.seed)))
    return outcomes


def named(faults: Sequence[Named], words: str) -> list[Named]:
    """Those with these words in their names.

    Raises:
        RefusedError: there are none.
    """
    found = [fault for fault in faults if words in fault.name]
    if not found:
        names = "; ".join(fault.name for fault in faults)
        raise RefusedError(f"--only: {words!r} is in no fault's name; there are: {names}")
    return found


@experiment("faults")
def run(arguments: argparse.Namespace) -> ExperimentReport | int:
    """Let every fault happen to flights of many seeds."""
    if arguments.live:
        return run_live(arguments)
    robot_file = load_robot(arguments.robot, takes=BY_GAINS)
    config = teleop_config(robot_file, arguments.gains, VirtualCameraConfig(), "relative")
    faults = named(FAULTS, arguments.only)
    outcomes = _outcomes(robot_file, config, faults, arguments)
    rows = [row_of(fault, [o for o in outcomes if o.fault == fault.name]) for fault in faults]
    times = times_of(faults, outcomes)
    vanished = vanish.fly(robot_file, config, arguments.vanish, arguments.workers)
    if vanished:
        times += vanish_times(vanished)
    print(f"{arguments.robot}, gains {arguments.gains}, hand moving; the worst of each")
    return ExperimentReport(
        {"rows": rows, "times": times},
        f"{dashed(COLUMNS, rows)}\n\n{dashed(TIMES, times)}",
        goals(rows, arguments.seeds, vanished),
        draw=lambda folder: (picture.draw(rows, folder / "faults.png"),),
    )


@experiment("faults_live")
def run_live(arguments: argparse.Namespace) -> ExperimentReport:
    """The ones that need real processes."""
    outcomes: list[LiveOutcome] = []
    faults = named(live.LIVE, arguments.only)
    for one in live.fly(arguments.robot, arguments.gains, arguments.live, faults):
        outcomes.append(one)
        print(text_of(one), flush=True)
    thrust, times = sum(one.after_zero for one in outcomes), live_times(faults, outcomes)
    holds = {
        f"live: {thrust} samples with thrust after zero, in {len(outcomes)} faults": thrust == 0,
        "live: each in time and within bounds": not any(one.missed for one in outcomes),
        **live_goals(faults, times),
    }
    return ExperimentReport({"rows": outcomes, "times": times}, dashed(TIMES, times), holds)


def text_of(one: LiveOutcome) -> str:
    """A line."""
    return (
        f"{one.fault:<24} coasts after {one.coasts_s:6.3f} s, ramps {one.ramps_s:6.3f} s, "
        f"falls {one.falls_s:5.2f} s, zero {one.zero_s:5.2f} s, "
        f"{one.after_zero} samples after, {one.excursion_mm:4.0f} mm  {one.missed}"
    )


def _outcomes(
    robot_file: RobotFile,
    config: TeleopConfig,
    faults: Sequence[Fault],
    arguments: argparse.Namespace,
) -> list[FaultOutcome]:
    names = [fault.name for fault in faults]
    jobs = [
        FaultJob(robot_file, config, seed, tuple(names[k : k + SHARED]))
        for seed in range(1, arguments.seeds + 1)
        for k in range(0, len(names), SHARED)
    ]
    outcomes: list[FaultOutcome] = []
    for some in processes.each(flown, jobs, arguments.workers):
        outcomes += some
        print(f"flown: {len(outcomes)} of {len(names) * arguments.seeds}", file=sys.stderr)
    return sorted(outcomes, key=lambda one: one.seed)


def goals(
    rows: Sequence[FaultRow], seeds: int, vanished: Sequence[Vanished] = ()
) -> dict[str, bool]:
    """What is to be shown, and whether it was."""
    thrust = sum(row.after_zero for row in rows)
    silent = f"{thrust} samples with thrust after zero, in {len(rows)} faults of {seeds} seeds"
    held = {silent: thrust == 0}
    held |= {f"{row.fault}: in time, within bounds": not row.missed for row in rows}
    return held | vanish.goals(vanished)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
    parser.add_argument("--seeds", type=whole(1, 1000), default=25, help="flights of each fault")
    parser.add_argument(
        "--live",
        type=whole(1, 1000),
        default=0,
        metavar="N",
        help="instead: kill and stop real processes in flight, each N times; Linux",
    )
    parser.add_argument(
        "--vanish", type=whole(0, 100_000), default=1000, help="phones that vanish for good"
    )
    parser.add_argument("--only", default="", metavar="WORDS", help="faults with these in the name")
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--gains", default="phone", help="a gain set of the robot file")
    parser.add_argument("--workers", type=whole(1, 256), default=processes.cores())
