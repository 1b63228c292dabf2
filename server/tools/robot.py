"""`lightleash robot WHAT`: examine a robot's file or flights, make its key, run its computer."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from hardware.follower import FollowerError
from hardware.led_layout.viewpoints import LedLayoutError
from hardware.link.link_key import LinkKeyError
from hardware.robot_file import RobotFileError
from hardware.robot_text import RobotTextError
from hardware.system_identification.fit import IdentificationError
from server.common.options import Parser
from server.common.runtime import BusyError
from server.process import robot_key
from server.recording.writer import RecordingError
from server.tools import onboard, robot_check
from server.tools.bring_up import command as bring_up
from server.tools.bring_up.pulses import BringUpError
from server.tools.identify import command as identify
from server.tools.led_layout import command as leds
from server.tools.led_layout.files import OutError
from server.tools.new_robot import command as new_robot

KINDS = {
    "new": new_robot,
    "check": robot_check,
    "leds": leds,
    "bring-up": bring_up,
    "identify": identify,
    "key": robot_key,
    "onboard": onboard,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash robot`."""
    words = "Examine a robot's file or flights, make a key, run the robot's own computer."
    parser = Parser(prog="lightleash robot", description=words)
    kinds = parser.add_subparsers(required=True, metavar="WHAT", dest="what")
    for name, kind in KINDS.items():
        one = kinds.add_parser(name, help=kind.HELP, description=kind.HELP)
        kind.add_arguments(one)
        one.set_defaults(run=kind.run)
    arguments = parser.parse_args(argv)
    try:
        code: int = arguments.run(arguments)
    except EOFError:  # Ctrl-D at a question
        said = "the input ended before all was answered: nothing is done"
        print(f"\nlightleash robot {arguments.what}: {said}", file=sys.stderr)
        return 2
    except (
        RobotFileError,
        LedLayoutError,
        OutError,
        LinkKeyError,
        FollowerError,
        IdentificationError,
        RecordingError,
        RobotTextError,
        BringUpError,
        BusyError,
        OSError,
    ) as error:
        print(f"lightleash robot {arguments.what}: {error}", file=sys.stderr)
        return 2
    return code
