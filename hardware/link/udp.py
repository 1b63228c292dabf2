"""Our own link over UDP: the default way to a robot, simulated or real.

| file                | what                                                             |
|---------------------|------------------------------------------------------------------|
| `datagram.py`       | both datagrams, byte by byte                                     |
| `blink_datagram.py` | a third one, that tells LEDs to blink                            |
| `health_datagram.py`| a fourth one, by which the robot tells how it is                 |
| `tool_datagram.py`  | a fifth one, that opens and closes its tool                      |
| `control_end.py`    | the control process's end without a socket                       |
| `robot_end.py`      | the robot's end without a socket: gate, watchdog, ramp           |
| `blink_end.py`      | the robot's end of blinking                                      |
| `health_end.py`     | the robot's end of telling how it is                             |
| `tool_end.py`       | the robot's end of its tool                                      |
| `deploy/watchdog/`  | the robot's end in C, for firmware                               |
| `link_follower.py`  | what this follower has in common with those of other links       |
| this file           | the socket of the control process                                |

The robot listens on a port and answers the first command of a new control process, of zero thrust;
the next one is fresh, and samples come at the robot's own rate. Neither end waits for the other.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from hardware.follower import FollowerError
from hardware.link.control_end import ControlEnd
from hardware.link.datagram import MAX_BYTES
from hardware.link.link_follower import DatagramFollower
from hardware.robot_file import RobotFile

MAX_SAMPLES = 256
"""Taken at once; the rest waits for the next call."""


class UdpFollower(DatagramFollower):
    """A robot at the other end of the network."""

    def __init__(
        self,
        host: str,
        port: int,
        end: ControlEnd,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Ready to talk with `host`:`port`; sends nothing yet.

        Raises:
            FollowerError: no such host.
        """
        super().__init__(end, clock)
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        except OSError as error:
            what = f"robot at {host}:{port}: {error}"
            raise FollowerError(what, "a host this machine knows") from error
        # a name may stand for both: robots listen by IPv4, as `robot_server.py` does
        by_ipv4_first = sorted(found, key=lambda one: one[0] != socket.AF_INET)
        family, kind, _, _, address = by_ipv4_first[0]
        self._socket = socket.socket(family, kind)
        self._socket.setblocking(False)
        self._socket.connect(address)  # from here on the kernel drops whatever others send

    def close(self) -> None:
        """Close. See `Follower`."""
        self._closed = True
        self._socket.close()

    def _post(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except OSError:  # refused: nobody listens there (yet); or the way is down or full
            self.lost += 1

    def _arrived(self) -> list[bytes]:
        arrived: list[bytes] = []
        for _ in range(MAX_SAMPLES):
            try:
                arrived.append(self._socket.recv(MAX_BYTES + 1))
            except BlockingIOError:
                break
            except OSError:  # tells of an earlier command that met a closed port
                self.lost += 1
        return arrived


def connect(robot_file: RobotFile, key: bytes, epoch: int) -> UdpFollower:
    """Link to the robot of a robot file. A `Connect` of `registry.py`.

    Raises:
        FollowerError: no such host.
    """
    link = robot_file.link
    return UdpFollower(link.host, link.port, ControlEnd.of(robot_file, key, epoch))
