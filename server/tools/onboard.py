"""`lightleash robot onboard`: what runs on the robot's own computer, before a flight controller."""

from __future__ import annotations

import argparse
from pathlib import Path

from hardware.flight_controller import process
from hardware.link.link_key import read_key
from hardware.robot_file import load_robot
from server.common.ranges import MOST_PORT, whole

HELP = "Run the robot's end of the link on its own computer, before its flight controller."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = parser.add_argument
    add("robot", metavar="ROBOT", help="name, or a .toml with [flight_controller]")
    add("--at", required=True, metavar="PORT", help="/dev/ttyACM0, or tcp:HOST:PORT")
    add("--key", type=Path, required=True, metavar="FILE", help="of `lightleash robot key`")
    add("--listen", default="0.0.0.0", metavar="ADDRESS", help="of the link; default: all")
    add(
        "--e-stop",
        type=Path,
        metavar="FILE",
        help="input of the emergency stop's wire, like /sys/class/gpio/gpio17/value: 1 is closed",
    )
    add("--port", type=whole(0, MOST_PORT), help="of the link; default: the robot file's")


def run(arguments: argparse.Namespace) -> int:
    """Run until SIGTERM, SIGINT or the end of the line; gives the exit code.

    Raises:
        RobotFileError: no such robot, or no [flight_controller].
        LinkKeyError: no key there.
        FollowerError: the flight controller can't be reached.
        OSError: the port is taken.
    """
    robot_file = load_robot(arguments.robot)
    port = robot_file.link.port if arguments.port is None else arguments.port
    listen = (arguments.listen, port)
    return process.run(robot_file, read_key(arguments.key), arguments.at, listen, arguments.e_stop)
