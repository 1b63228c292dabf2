"""`lightleash robot key`: make the key that a real robot and its control process share."""

from __future__ import annotations

import argparse
from pathlib import Path

from hardware.link.link_key import LinkKeyError, new_key, read_key, write_key
from hardware.robot_file import COMMANDS, load_robot
from server.common.settings import state_directory

HELP = "Make the key that a real robot and its control process share."
ROBOTS = "robots"
ADVICE = """\
Flash its 16 bytes, written there as 32 hexadecimal digits, into the robot's firmware (`ll_init` in
deploy/watchdog/, whose example program reads such a file). Whoever has the key can fly the robot:
make another one, with --force, when somebody else may have it."""


def key_file(state: Path, robot: str) -> Path:
    """Where the key of a robot is kept; `robot` is its name in the robot file."""
    return state / ROBOTS / f"{robot}.key"


def epoch_file(state: Path, robot: str) -> Path:
    """Where the newest epoch of its control processes is kept."""
    return state / ROBOTS / f"{robot}.epoch"


def key_of(state: Path, robot: str, named: str) -> bytes:
    """The key of a real robot, which people have `named` by itself or by its file.

    Raises:
        LinkKeyError: none yet, or it can't be used; names the command that makes one.
    """
    file = key_file(state, robot)
    if not file.exists():
        raise LinkKeyError(
            f"robot {robot}",
            f"a real robot needs a key: make it by `lightleash robot key {named}`",
        )
    return read_key(file)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("robot", metavar="ROBOT", nargs="?", default="ames", help="name or .toml")
    state = state_directory()
    parser.add_argument("--state", type=Path, default=state, help="default: %(default)s")
    parser.add_argument("--force", action="store_true", help="replace the key there is")


def run(arguments: argparse.Namespace) -> int:
    """Make it, say where it is.

    Raises:
        RobotFileError: no such robot.
        LinkKeyError: it has a key, or the key can't be written.
    """
    name = load_robot(arguments.robot, takes=COMMANDS).robot.name
    file = key_file(arguments.state, name)
    write_key(file, new_key(), force=arguments.force)
    print(f"The key of the robot {name!r} is in {file}, for its owner alone.\n{ADVICE}")
    return 0
