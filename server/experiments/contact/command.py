"""The command: fly each scene stiff and compliant; print, write JSON, draw."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from hardware.robot_file import RobotFile, load_robot
from hardware.sim.plant.obstacle import Socket
from server.common.ranges import number, whole
from server.experiments.contact import assumptions, picture
from server.experiments.contact.flight import ContactTrace, fly
from server.experiments.contact.free import NEAR, Free, free_flights, free_table
from server.experiments.contact.measure import ContactRow, row_of, table_of
from server.experiments.contact.setting import LEAST_N, ContactScene, Way, predicted_n
from server.experiments.paper.setup.variants import check_gains
from server.experiments.runner import ExperimentReport, RefusedError, experiment
from server.simulation.sensors import PAPER, Leader, phone

STIFF: Final = Way("stiff", None)
IN_BAND_PCT: Final = 95.0
"""Of the time of pressing: held."""


@experiment("contact")
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Fly each scene stiff and compliant, and each way in the free."""
    leader = PAPER if arguments.leader == PAPER.name else phone(arguments.fps)
    robot_file = load_robot(arguments.robot)
    check_gains(robot_file, arguments.robot)
    flown = flown_of(arguments, robot_file)
    seeds = range(1, arguments.seeds + 1)
    said = assumptions.of(robot_file.plant, leader, [scene for scene, _ in flown], arguments.seeds)
    print(assumptions.lines(said), flush=True)
    rows: list[ContactRow] = []
    shown: list[tuple[ContactRow, ContactTrace]] = []
    for scene, way in flown:
        predicted = predicted_n(way.limit_n or max(arguments.limit_n), scene, robot_file.plant)
        traces = [_flown(robot_file, leader, scene, way, seed) for seed in seeds]
        rows.append(row_of(scene, way, predicted, traces))
        shown.append((rows[-1], traces[0]))
    free = free_flights(robot_file, leader, [STIFF, *_soft(arguments)], list(seeds))
    return ExperimentReport(
        {"assumptions": assumptions.json(said), "seeds": list(seeds), "rows": rows, "free": free},
        f"\n{table_of(rows)}\n\n{free_table(free)}",
        goals(rows, free),
        draw=lambda folder: (picture.draw(shown, folder / "contact.png"),),
    )


def flown_of(
    arguments: argparse.Namespace, robot_file: RobotFile
) -> list[tuple[ContactScene, Way]]:
    """Each scene with each controller; a socket only with limits that reach its bottom.

    Raises:
        RefusedError: no limit reaches an obstacle; says which would.
    """
    gap, beyond = 1e-3 * arguments.gap_mm, 1e-3 * arguments.depth_mm
    socket = Socket(1e-3 * arguments.clearance_mm, 1e-3 * arguments.chamfer_mm)
    flown = []
    for scene in (ContactScene("wall", gap, beyond), ContactScene("socket", gap, beyond, socket)):
        soft = [
            way
            for way in _soft(arguments)
            if predicted_n(way.limit_n or 0.0, scene, robot_file.plant) >= LEAST_N
        ]
        if not soft:
            least = LEAST_N - predicted_n(0.0, scene, robot_file.plant)
            raise RefusedError(
                f"--limit-n: none reaches the {scene.name}, the suspension pulls back; "
                f"allowed: one of {least:.1f} or more, or a smaller --gap-mm"
            )
        flown += [(scene, way) for way in (STIFF, *soft)]
    return flown


def _soft(arguments: argparse.Namespace) -> list[Way]:
    return [Way(f"compliant {limit:g} N", limit) for limit in arguments.limit_n]


def _flown(
    robot_file: RobotFile, leader: Leader, scene: ContactScene, way: Way, seed: int
) -> ContactTrace:
    """A flight, and a word of progress."""
    trace = fly(robot_file, leader, scene, way, seed)
    print(f"flown: {scene.name}, {way.name}, seed {seed}", file=sys.stderr, flush=True)
    return trace


def goals(rows: Sequence[ContactRow], free: Sequence[Free]) -> dict[str, bool]:
    """What is to be shown, and whether it was."""
    soft = [row for row in rows if row.way != STIFF.name]
    plugs = [row for row in soft if row.plugged]
    walls = [row for row in soft if not row.plugged]
    stiff = {one.hand: one.rms_mm for one in free if one.way == STIFF.name}
    return {
        f"compliant, a wall: in the band {IN_BAND_PCT:g} % of the time of pressing": all(
            row.in_band_pct >= IN_BAND_PCT for row in walls
        ),
        "compliant: contact is never lost while pressing": all(
            row.lost == 0 and row.touching_pct > 0.0 and not row.ended for row in soft
        ),
        "compliant: the plug goes in, and out again": all(
            len(set(row.plugged.split("/"))) == 1 and row.out == row.plugged for row in plugs
        ),
        "compliant, in the free near where it began: error no more than 2 % above stiff": all(
            one.rms_mm <= 1.02 * stiff[NEAR] for one in free if one.hand == NEAR
        ),
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--out", type=Path, default=None, help="folder for picture and JSON")
    parser.add_argument("--seeds", type=whole(1, 1000), default=3, help="flights of each kind")
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--leader", choices=(PAPER.name, "phone"), default="phone")
    parser.add_argument("--fps", type=number(5.0, 240.0), default=30.0, help="of a phone")
    parser.add_argument(
        "--limit-n",
        nargs="+",
        type=number(0.2, 20.0),
        default=[1.5, 3.0],
        help="of compliance, beyond what holds the robot",
    )
    parser.add_argument(
        "--gap-mm", type=number(5.0, 500.0), default=20.0, help="from the tip to the wall, at rest"
    )
    parser.add_argument(
        "--depth-mm",
        type=number(5.0, 300.0),
        default=50.0,
        help="how far the reference goes behind the obstacle",
    )
    parser.add_argument("--clearance-mm", type=number(0.5, 100.0), default=5.0, help="of the plug")
    parser.add_argument("--chamfer-mm", type=number(1.0, 40.0), default=10.0, help="of the socket")
