"""The command: which experiments, with which sensors; print, write JSON, draw."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, Protocol, get_args

from hardware.robot_file import load_robot
from pipeline.config import EstimatorName, VirtualCameraMode
from server.common.ranges import number, whole
from server.experiments import processes
from server.experiments.paper import comparison, disturbance, table_1, table_3, table_4
from server.experiments.paper.setup import assumptions, published
from server.experiments.paper.setup.measure import ExperimentSetup
from server.experiments.paper.setup.variants import Variant, VariantRequest, check_gains, ours
from server.experiments.runner import ExperimentReport, RefusedError, experiment
from server.simulation.sensors import PAPER, Leader, Pictures, phone


class Reported(Protocol):
    """What an experiment gives."""

    @property
    def name(self) -> str:
        """Name of its JSON file."""

    @property
    def holds(self) -> Mapping[str, bool]:
        """Statements, and whether they hold."""

    def text(self) -> str:
        """To print."""

    def json(self) -> dict[str, object]:
        """To write."""

    def draw(self, folder: Path) -> list[Path]:
        """Pictures."""


Measure = Callable[[ExperimentSetup, Sequence[Variant]], Reported]
EXPERIMENTS: Final[dict[str, tuple[Measure, VirtualCameraMode]]] = {
    table_1.NAME: (table_1.measure, "off"),
    table_3.NAME: (table_3.measure, "off"),
    table_4.NAME: (table_4.measure, "selective"),
    disturbance.NAME: (disturbance.measure, "selective"),
    comparison.NAME: (comparison.measure, "selective"),
}
"""Each with the virtual camera that ours has in it unless another is requested."""


@experiment("paper")
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Fly each table; what the paper says must hold with its own sensors."""
    request, leader = request_of(arguments), leader_of(arguments)
    robot_file = load_robot(arguments.robot)
    check_gains(robot_file, arguments.robot, arguments.gains)
    setup = ExperimentSetup(
        robot_file, leader, tuple(range(1, arguments.seeds + 1)), arguments.workers
    )
    print(published.SOURCE)
    print(assumptions.lines(assumptions.of(setup)))
    adds = bool(request) or leader.name != PAPER.name
    outcomes = []
    for name in arguments.only or EXPERIMENTS:
        measure, vci = EXPERIMENTS[name]
        outcome = measure(setup, [ours(leader, request, vci)] if adds else [])
        outcomes.append(outcome)
        print(f"\n{outcome.text()}", flush=True)
    assumed = assumptions.json(assumptions.of(setup))
    return ExperimentReport(
        {"source": published.SOURCE, "assumptions": assumed}
        | {outcome.name: outcome.json() for outcome in outcomes},
        is_good=leader.name != PAPER.name or all(all(one.holds.values()) for one in outcomes),
        draw=lambda folder: [path for outcome in outcomes for path in outcome.draw(folder)],
    )


def leader_of(arguments: argparse.Namespace) -> Leader:
    """The paper's sensors, or a phone with its rate and delay.

    Raises:
        RefusedError: pictures that the paper's sensors have not; says what is allowed.
    """
    if arguments.leader == PAPER.name:
        if arguments.pictures != PAPER.pictures:
            raise RefusedError(
                f"--pictures {arguments.pictures}: allowed with --leader {PAPER.name}: "
                f"{PAPER.pictures}; its camera's 500 pictures/s went through no codec"
            )
        return PAPER
    low, high = sorted(arguments.latency_ms)
    return phone(arguments.fps, (1e-3 * low, 1e-3 * high), arguments.pictures)


def request_of(arguments: argparse.Namespace) -> VariantRequest:
    """What was asked for."""
    return VariantRequest(
        arguments.estimator,
        arguments.gains,
        arguments.vci,
        arguments.cutoff_hz,
        arguments.feedforward,
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--out", type=Path, default=None, help="folder for pictures and JSON")
    parser.add_argument("--only", nargs="+", choices=tuple(EXPERIMENTS), help="not all of them")
    parser.add_argument("--seeds", type=whole(1, 1000), default=3, help="flights of each kind")
    parser.add_argument(
        "--workers",
        type=whole(1, 256),
        default=processes.cores(),
        help="processes for Table III; else one for each core",
    )
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--leader", choices=(PAPER.name, "phone"), default=PAPER.name)
    parser.add_argument("--fps", type=number(5.0, 240.0), default=30.0, help="of a phone")
    parser.add_argument(
        "--latency-ms",
        nargs=2,
        type=number(1.0, 400.0),
        default=(60.0, 120.0),
        metavar=("LOW", "HIGH"),
        help="of a phone's pictures",
    )
    parser.add_argument(
        "--pictures",
        choices=get_args(Pictures),
        default=PAPER.pictures,
        help="spots: LEDs with a camera's noise; else a phone's pictures are rendered, encoded, "
        "decoded and looked at",
    )
    add = parser.add_argument_group("a column of our own, beside the paper's")
    add.add_argument("--estimator", choices=get_args(EstimatorName))
    add.add_argument("--gains", help="a gain set of the robot file")
    add.add_argument("--vci", choices=get_args(VirtualCameraMode))
    add.add_argument("--cutoff-hz", type=number(0.01, 10.0), help="of the VCI; else the paper's")
    add.add_argument("--feedforward", action=argparse.BooleanOptionalAction, default=None)
