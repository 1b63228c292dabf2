"""What runs on the robot's own computer: `lightleash robot onboard ROBOT --at /dev/ttyACM0`."""

from __future__ import annotations

import secrets
import signal
import sys
import time
from pathlib import Path

from hardware.flight_controller.robot_computer import RobotComputer
from hardware.follower import FollowerError
from hardware.link.control_end import random_u64
from hardware.link.robot_server import Address, RobotServer, be_punctual
from hardware.link.serial_line import SerialLine
from hardware.robot_file import RobotFile

STOP_REPEATS, STOP_EVERY_S = 10, 0.01
"""At the end: the motors turn on if the last word is lost."""

CLOSED = b"1"
"""Of an emergency stop's wire."""


class OnboardProcess:
    """Our link on one side, the flight controller's serial line on the other."""

    def __init__(
        self,
        robot_file: RobotFile,
        key: bytes,
        stream: SerialLine,
        listen: Address,
        e_stop: Path | None = None,
    ) -> None:
        """Bound, not running; `e_stop` is the file of the wire, of a robot that has one.

        Raises:
            RobotFileError: the file does not tell of a flight controller.
            OSError: the port is taken.
        """
        self.robot = RobotComputer(robot_file, secrets.randbits(32), random_u64, key)
        self._stream, self._said = stream, ""
        self._e_stop = e_stop
        self.server = RobotServer(self.robot, listen, self._tick)
        self.server.watch(stream.fileno(), self._read)

    def run(self) -> None:
        """Until stopped, or until the flight controller hangs up; then switch the motors off.

        Raises:
            FollowerError: it has hung up.
        """
        try:
            self.server.run()
        finally:
            for _ in range(STOP_REPEATS):
                self._stream.write(self.robot.shut_down())
                time.sleep(STOP_EVERY_S)
            self._stream.close()
            self.server.close()

    def _tick(self, now_us: int) -> tuple[bytes, ...]:
        if self._e_stop is not None:
            self.robot.end.wire(is_open=is_open(self._e_stop))
        self._stream.write(self.robot.tick(now_us))
        unfit = self.robot.flight_controller.unfit
        if unfit != self._said:
            self._said = unfit
            sys.stdout.write((unfit or "The flight controller answers.") + "\n")
            sys.stdout.flush()
        return ()

    def _read(self) -> None:
        self.server.send(self.robot.feed(self._stream.read(), self.server.now_us))


def is_open(wire: Path) -> bool:
    """Whether an emergency stop's wire is, by a file that Linux makes of an input: `1` is closed.

    Anything else is open, a file that can't be read, too.
    """
    try:
        with wire.open("rb") as file:
            return file.read(1) != CLOSED
    except OSError:
        return True


def run(
    robot_file: RobotFile,
    key: bytes,
    where: str,
    listen: Address,
    e_stop: Path | None = None,
) -> int:
    """Run until SIGTERM or SIGINT; gives the exit code.

    Raises:
        FollowerError: the flight controller can't be reached.
        RobotFileError, OSError: as `OnboardProcess`.
    """
    process = OnboardProcess(robot_file, key, SerialLine(where), listen, e_stop)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, process.server.stop)
    be_punctual()
    sys.stdout.write(f"ready port={process.server.port}\n")
    sys.stdout.flush()
    try:
        process.run()
    except FollowerError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0
