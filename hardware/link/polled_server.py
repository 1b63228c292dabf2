"""Socket, clock and thread around a robot that is asked: for a program with a loop of its own."""

from __future__ import annotations

import secrets
from threading import Thread

from hardware.link.control_end import random_u64
from hardware.link.polled_robot import PolledRobot, PolledTwist
from hardware.link.robot_server import Address, RobotServer
from hardware.robot_file import RobotFile


class PolledServer:
    """Listens to control from its making on, until it is closed."""

    def __init__(self, robot_file: RobotFile, key: bytes, listen: Address) -> None:
        """Listening. Port 0 takes any free one.

        Raises:
            RobotFileError: a robot that can't be asked; see `PolledRobot`.
            OSError: the address can't be had.
        """
        self._robot = PolledRobot(robot_file, secrets.randbits(32), random_u64, key)
        self._server = RobotServer(self._robot, listen, self._robot.tick)
        self._thread = Thread(target=self._server.run, name="lightleash", daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._server.port

    @property
    def is_alive(self) -> bool:
        """Not closed, and nothing has ended its thread."""
        return self._thread.is_alive()

    def ask(self) -> PolledTwist:
        """What the robot is to do now."""
        return self._robot.ask(self._server.now_us)

    def close(self) -> None:
        """Tell control that the robot refuses, and give the port back."""
        self._server.stop()
        self._thread.join()
        self._server.send((self._robot.shut_down(self._server.now_us),))
        self._server.close()
