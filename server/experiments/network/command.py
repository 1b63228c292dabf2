"""`lightleash experiments network`: a phone by WebRTC and by websockets, over bad lines."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from hardware.sim.network.emulated_link import EmulatedLink
from hardware.sim.network.netns import NamespaceError
from server.common.ranges import number, seed_number
from server.common.text import table
from server.experiments.network.figures import drops, percentile, recovery
from server.experiments.network.phone import CLIENTS, FRAME_RATE_HZ
from server.experiments.network.picture import draw
from server.experiments.network.run import NetworkTestbed, Run, RunError
from server.experiments.network.scenarios import SCENARIOS, Scenario
from server.experiments.runner import ExperimentReport, experiment

COLUMNS = (
    ("scenario", "line", "{}"),
    ("path", "path", "{}"),
    ("frame_p50_ms", "frame p50", "{:.0f}"),
    ("frame_p95_ms", "p95 ms", "{:.0f}"),
    ("drops_pct", "drops %", "{:.1f}"),
    ("operator_p50_ms", "record p50", "{:.0f}"),
    ("operator_p999_ms", "p99.9 ms", "{:.0f}"),
    ("echo_p999_ms", "echo p99.9", "{:.0f}"),
    ("recovery_s", "again after s", "{:.2f}"),
    ("late_ms", "line late ms", "{:.1f}"),
    ("verdict", "goals", "{}"),
)
NEEDS_TIME_S = 8.0
"""The shortest run with a fault in it, and time to recover."""


@dataclass(frozen=True, slots=True)
class NetworkRow:
    """Figures of one run; times in ms unless the name says otherwise."""

    scenario: str
    path: str
    frame_p50_ms: float
    """Of a picture that comes, since it left the sensor: encoding and the whole way."""
    frame_p95_ms: float
    drops_pct: float
    """Of the camera's pictures, those that never came to the decoder."""
    operator_p50_ms: float
    """Of the newest motion or touch, at any time."""
    operator_p999_ms: float
    echo_p999_ms: float
    """Since the newest ping that came back in a touch went out: control's measure."""
    recovery_s: float
    """From the end of a fault until pictures are fresh again, the median; NaN without faults."""
    worst_recovery_s: float
    late_ms: float
    """By how much the emulator itself was late, p99."""
    video_path: str
    undecodable: int
    skipped: int
    ended: str
    verdict: str


def row_of(scenario: Scenario, path: str, run: Run) -> NetworkRow:
    """Figures of a run."""
    begin, end = run.begin, run.end
    frames = 1e3 * run.frames.within(begin, end).ages
    operator = 1e3 * run.records.ages_of_newest(begin, end)
    again = [recovery(run.frames, t_over) for t_over in run.fault_ends]
    row = NetworkRow(
        scenario.name,
        path,
        percentile(frames, 50.0),
        percentile(frames, 95.0),
        100.0 * drops(run.frames, begin, end, FRAME_RATE_HZ),
        percentile(operator, 50.0),
        percentile(operator, 99.9),
        percentile(1e3 * run.echoes.ages_of_newest(begin, end), 99.9),
        float(np.median(again)) if again else float("nan"),
        max(again, default=float("nan")),
        1e3 * run.lateness.p99,
        run.video_path,
        run.undecodable,
        run.skipped,
        run.ended,
        "",
    )
    return replace(row, verdict=verdict_of(scenario, row) if path == "webrtc" else "")


def misses(scenario: Scenario, row: NetworkRow) -> Iterator[str]:
    """Which goals were not met, in words."""
    if row.ended:
        yield row.ended
    for name, goal in asdict(scenario.goals).items():
        if goal is not None and not getattr(row, name) <= goal:
            yield f"{name} > {goal:g}"


def verdict_of(scenario: Scenario, row: NetworkRow) -> str:
    """What was missed, or "met"; "" if nothing is asked."""
    is_asked = any(goal is not None for goal in asdict(scenario.goals).values())
    return ", ".join(misses(scenario, row)) or ("met" if is_asked else "")


def measure(arguments: argparse.Namespace) -> Iterator[tuple[Scenario, str, Run]]:
    """Each scenario by each path, one after the other.

    Raises:
        NamespaceError: this machine, or this user, can't make networks.
        RunError: a process did not do its part.
    """
    with EmulatedLink() as link:
        rig = NetworkTestbed(link)
        try:
            for name in arguments.scenarios:
                for path in arguments.paths:
                    scenario = SCENARIOS[name]
                    yield scenario, path, rig.run(scenario, path, arguments.seconds, arguments.seed)
        finally:
            rig.close()


@experiment("network", NamespaceError, RunError)
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Each scenario by each path."""
    flown: list[tuple[NetworkRow, Run]] = []
    for scenario, path, one in measure(arguments):
        flown.append((row_of(scenario, path, one), one))
        print(f"{scenario.name}, {path}: {scenario.description}", file=sys.stderr, flush=True)
    print(
        f"640x480, {FRAME_RATE_HZ:g} pictures a second, {arguments.seconds:g} s each, seed "
        f"{arguments.seed}; both directions alike; goals are those of webrtc"
    )

    def drawn(folder: Path) -> list[Path]:
        runs = [(row.scenario, row.path, run) for row, run in flown]
        return [draw(runs, folder / "network.png")]

    return ExperimentReport(
        [_row_json(row, run) for row, run in flown],
        table(COLUMNS, [row for row, _ in flown]),
        is_good=all(row.verdict in ("", "met") for row, _ in flown),
        draw=drawn,
    )


def _row_json(row: NetworkRow, run: Run) -> dict[str, object]:
    """For programs, to a thousandth."""
    rounded = {k: round(v, 3) if isinstance(v, float) else v for k, v in asdict(row).items()}
    return rounded | {"to_phone": run.counts[0], "to_server": run.counts[1]}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    descriptions = "; ".join(
        f"{one.name}: {one.description}" for one in SCENARIOS.values()
    ).replace("%", "%%")
    parser.add_argument(
        "--scenarios", nargs="+", choices=SCENARIOS, default=list(SCENARIOS), help=descriptions
    )
    parser.add_argument("--paths", nargs="+", choices=CLIENTS, default=list(CLIENTS))
    parser.add_argument(
        "--seconds",
        type=number(NEEDS_TIME_S, 3600.0),
        default=30.0,
        help="of each scenario and path",
    )
    parser.add_argument(
        "--seed", type=seed_number, default=0, help="of the line's chances and of the hand"
    )
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
