"""A robot whose Simulink model speaks by RPIt's socket block: `[link] kind = "rpit"`.

The block is the client: it sends its con to a port of ours, waits for a mes, at most for a second,
and sends again, without a rest. So here we listen, and whoever answers each con at once drives the
block at tens of thousands of exchanges a second, while one who answers once stands still for that
second whenever a packet is lost. We do neither: a mes goes out with each command, at control's own
200 Hz, to where the robot was last heard, whether or not it has said anything. Then the block says
something 200 times a second, too, and a lost packet costs one exchange.

A sample is as old as our tick and the model's: it waits for the mes that asks for it.

The block shows the last mes for ever when we die. So the model must watch for itself as
`docs/rpit.md` says; that it does nobody can see from here, so a robot is armed only if its file
says who stops it (`stopped_by`).
"""

from __future__ import annotations

import time
from collections.abc import Callable

from hardware.follower import BodySample, FollowerError, RobotCommand
from hardware.link.address import ANYBODY, address_of
from hardware.link.control_end import ControlEnd
from hardware.link.link_follower import LinkFollower
from hardware.link.robot_end import Peer
from hardware.link.robot_server import bound
from hardware.link.rpit.ground_end import GroundEnd, random_whole
from hardware.link.rpit.structs import STRUCT, WHOLE
from hardware.robot_file import RobotFile

MAX_CONS = 256
"""Taken at once; the rest waits for the next call."""
NO_KEY = b""  # nobody shares one here


class RpitFollower(LinkFollower[GroundEnd]):
    """A robot that speaks to a port of ours."""

    def __init__(
        self,
        address: Peer,
        end: GroundEnd,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Listens at `address`; sends nothing before it has heard something.

        Raises:
            FollowerError: somebody else listens there.
        """
        super().__init__(end, clock)
        self.thrusters = end.thrusters
        try:
            self._socket = bound(address)
        except OSError as error:
            what = f"port {address[1]} of {address[0]}: {error}"
            raise FollowerError(what, "a free UDP port (link.port) for RPIt's client") from error

    @property
    def port(self) -> int:
        """Where we listen."""
        port: int = self._socket.getsockname()[1]
        return port

    def receive(self) -> list[BodySample]:
        """Return what has arrived. See `Follower`."""
        self._check_open()
        samples: list[BodySample] = []
        for _ in range(MAX_CONS):
            try:
                data, sender = self._socket.recvfrom(STRUCT.size + 1)
            except OSError:  # nothing more has come, or the way is down
                break
            sample = self._end.receive(data, sender, self._clock())
            samples += [sample] if sample is not None else []
        return samples

    def close(self) -> None:
        """Close. See `Follower`."""
        self._closed = True
        self._socket.close()

    def _send(self, command: RobotCommand) -> None:
        data = self._end.command(command, self._clock())
        try:
            if self._end.peer is None:
                self.lost += 1
            else:
                self._socket.sendto(data, self._end.peer)
        except OSError:  # the way is down or full
            self.lost += 1


def connect(robot_file: RobotFile, _key: bytes, epoch: int) -> RpitFollower:
    """Link to the robot of a robot file. A `Connect` of `registry.py`.

    Raises:
        FollowerError: no such host, its port is taken, or an epoch that no double holds.
    """
    if not 0 < epoch < WHOLE - 1:
        raise FollowerError(f"epoch {epoch}", f"1 to {WHOLE - 2}: is this machine's clock right?")
    link = robot_file.link
    host = address_of(link.host, "whoever speaks first")
    here = host if host.startswith("127.") else ANYBODY
    end = GroundEnd(ControlEnd.of(robot_file, NO_KEY, epoch, random_whole), host)
    return RpitFollower((here, link.port), end)
