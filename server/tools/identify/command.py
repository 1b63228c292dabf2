"""`lightleash robot identify`: mass, inertia, suspension, lag, thrusters, by recorded flights."""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from hardware.robot_file import ROBOTS, load_robot, robot_of, robot_path
from hardware.robot_text import RobotTextError, with_intervals, with_numbers
from hardware.system_identification.fit import IdentificationError, IdentifiedPlant, identify
from server.common.runtime import replacement
from server.common.text import table
from server.export.decoded import DecodedRecording, RecordedState
from server.recording.reader import read
from server.recording.writer import ROBOT_KEY
from server.tools.identify.findings import (
    FoundNumber,
    file_intervals,
    file_numbers,
    found_numbers,
    objections,
)
from server.tools.identify.recorded_flights import flights_of

HELP = "What are a robot's mass, inertia, suspension, lag and thrusters, by recorded flights?"
COLUMNS = (
    ("key", "number", "{}"),
    ("in_file", "file", "{:.4g}"),
    ("found", "found", "{:.4g}"),
    ("half_95", "± 95 %", "{:.2g}"),
    ("unit", "", "{}"),
)
PER_MASS = (
    "Motion sensors can't tell a heavy robot with strong thrusters from a light one with weak ones:"
    " these are the numbers of one whose thrusters, on average, give what they are commanded."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("recordings", metavar="RECORDING", type=Path, nargs="+")
    parser.add_argument("--robot", help="name or .toml; default: as the first recording has it")
    parser.add_argument("--out", type=Path, metavar="FILE.toml", help="a copy with what was found")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Find, print, write; 1 if something speaks against flying by it.

    Raises:
        RobotFileError, RecordingError, IdentificationError, RobotTextError: can't be used; why.
    """
    out: Path | None = arguments.out
    if out is not None and (out.suffix != ".toml" or out.exists()):
        raise RobotTextError("--out", f"{out}: allowed: a new path ending in .toml")
    if out is not None and not out.parent.is_dir():
        raise RobotTextError("--out", f"there is no folder {out.parent}")
    recordings = [DecodedRecording(read(path)) for path in arguments.recordings]
    robot_file = load_robot(arguments.robot) if arguments.robot else recordings[0].robot
    if robot_file.robot.twist is not None:
        raise IdentificationError("this robot takes a twist: it has no thrusters to identify")
    if robot_file.robot.attitude is not None:
        raise IdentificationError("this robot takes an attitude: its thrusters are untold")
    if robot_file.plant.stand is not None and not robot_file.robot.weight_to_carry:
        raise IdentificationError("this robot stands: its friction is not in the model")
    flights = [flight for one in recordings for flight in flights_of(_states(one))]
    identified = identify(robot_file.plant, flights)
    numbers, against = found_numbers(robot_file.plant, identified), objections(identified)
    if arguments.json:
        told = {"seconds": identified.seconds, "explained": identified.explained.tolist()}
        found = [asdict(one) | {"is_told": one.is_told} for one in numbers]
        print(json.dumps(told | {"numbers": found, "against": against}, indent=1))
    else:
        print(report(robot_file.robot.name, identified, numbers, against))
    if out is not None and not against:
        text = _text(arguments.robot, recordings[0])
        text = with_numbers(text, *file_numbers(robot_file.plant, numbers))
        text = with_intervals(text, file_intervals(numbers), "robot identify")
        robot_of(tomllib.loads(text), str(out))  # nothing is written that can't be loaded
        with replacement(out) as new:
            new.write_text(text, encoding="utf-8", newline="")
        where = sys.stderr if arguments.json else sys.stdout  # JSON stands alone
        print(f"written: {out}; before you fly it: lightleash robot check {out}", file=where)
    return int(bool(against))


def _states(recording: DecodedRecording) -> list[RecordedState]:
    return [item for item in recording.items() if isinstance(item, RecordedState)]


def _text(robot: str | None, recording: DecodedRecording) -> str:
    """The robot file's own."""
    recorded = recording.recording.metadata.get(ROBOT_KEY)
    if robot is None and recorded:
        return recorded
    path = robot_path(robot) if robot else ROBOTS / "ames.toml"
    return path.read_text(encoding="utf-8")


def report(
    name: str, identified: IdentifiedPlant, numbers: Sequence[FoundNumber], against: Sequence[str]
) -> str:
    """What was found, for people."""
    shares = ", ".join(f"{100.0 * share:.0f}" for share in identified.explained)
    lines = [
        f"{name}: {identified.seconds:.0f} s of flight; of how it moved and turned about x, y, z"
        f" {shares} % are explained",
        table(COLUMNS, [one for one in numbers if one.is_told]),
        PER_MASS,
    ]
    untold = [one for one in numbers if not one.is_told]
    lines += [f"not told by this flight: {one.key}; to find it {one.fly}" for one in untold]
    lines += [f"!!  {words}" for words in against]
    return "\n".join(lines)
