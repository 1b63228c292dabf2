"""A virtual phone in a hand that neither arms nor presses: the robot can be armed, by others.

python -m tests.e2e.idle_phone
"""

from __future__ import annotations

import asyncio

from hardware.robot_file import COMMANDS, load_robot
from server.common.access import access_of
from server.protocol.messages import Command
from server.virtual_phone.command import make_parser, make_script
from server.virtual_phone.live_phone import LivePhone
from server.virtual_phone.phone_script import VirtualOperator


class Idler(VirtualOperator):
    """Looks on."""

    def see(self, mode: str, ready: bool, t: float) -> Command | None:
        """Wish for nothing."""
        return None


async def play() -> None:
    """Until it is ended."""
    arguments = make_parser().parse_args(["--hand", "still", "--fps", "15"])
    access = access_of(arguments)
    robot_file = load_robot(access.robot, takes=COMMANDS)
    script = make_script(arguments, robot_file, access.truth_port)
    script.operator = Idler()
    phone = LivePhone(access, script, access.truth_port, robot_file.robot.axes)
    await phone.run(float("inf"), lambda _: None)


if __name__ == "__main__":
    asyncio.run(play())
