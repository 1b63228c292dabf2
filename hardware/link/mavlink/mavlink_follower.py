"""An autopilot of PX4 or ArduPilot: `[link] kind = "mavlink"`, registered as other packages' are.

We listen on a port, as autopilots, routers and simulators expect of who commands them, and answer
where the autopilot was heard. Its own time-out stops it when nothing comes any more, so a robot is
armed only if its file says so (`stopped_by`); given back, the link's last words are zeros to one
that takes a twist.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from hardware.follower import BodySample, FollowerError, RobotCommand, RobotHealth
from hardware.link.address import ANYBODY, address_of
from hardware.link.link_follower import LinkFollower
from hardware.link.mavlink.autopilot_end import AutopilotEnd
from hardware.link.registry import LinkKind
from hardware.link.robot_end import Peer
from hardware.link.robot_server import bound
from hardware.robot_file import RobotFile
from pipeline.estimation.standing_camera import StandingPose

MOST_DATAGRAMS = 256
"""Taken at once; the rest waits for the next call."""
MOST_BYTES = 2048
"""Of a datagram: networks carry 1500, and what is cut off is damaged."""


class MavlinkFollower(LinkFollower[AutopilotEnd]):
    """An autopilot that speaks to a port of ours."""

    def __init__(
        self,
        address: Peer,
        end: AutopilotEnd,
        clock: Callable[[], float] = time.monotonic,
        *,
        wants_vision: bool = False,
        thrusters: int = 0,
    ) -> None:
        """Listens at `address`; says nothing before it has heard something.

        Raises:
            FollowerError: somebody else listens there.
        """
        super().__init__(end, clock)
        self.thrusters = thrusters
        self.wants_vision = wants_vision
        """See `TakesVision`."""
        try:
            self._socket = bound(address)
        except OSError as error:
            what = f"port {address[1]} of {address[0]}: {error}"
            raise FollowerError(what, "a free UDP port (link.port) for MAVLink") from error

    @property
    def port(self) -> int:
        """Where we listen."""
        port: int = self._socket.getsockname()[1]
        return port

    @property
    def health(self) -> tuple[RobotHealth, float] | None:
        """See `TellsHealth`."""
        return self._end.health

    def receive(self) -> list[BodySample]:
        """Return what has arrived. See `Follower`."""
        self._check_open()
        samples: list[BodySample] = []
        for _ in range(MOST_DATAGRAMS):
            try:
                data, sender = self._socket.recvfrom(MOST_BYTES)
            except OSError:  # nothing more has come, or the way is down
                break
            samples += self._end.receive(data, sender, self._clock())
            self._tell(self._end.answers())
        if (sample := self._end.beat(self._clock())) is not None:
            samples.append(sample)
        return samples

    def see(self, seen: StandingPose) -> None:
        """See `TakesVision`."""
        self._check_open()
        self._tell([self._end.vision(seen)])

    def close(self) -> None:
        """Close. See `Follower`.

        Not without a word, but to one that takes attitude and thrust: others hover by zero.
        """
        if not self.thrusters:
            self.stop()
        self._closed = True
        self._socket.close()

    def _send(self, command: RobotCommand) -> None:
        if not self._tell(self._end.command(command, self._clock())):
            self.lost += 1

    def _tell(self, packets: Iterable[bytes]) -> bool:
        """Whether they went where the autopilot was heard."""
        if self._end.peer is None:
            return False
        try:
            for packet in packets:
                self._socket.sendto(packet, self._end.peer)
        except OSError:  # the way is down or full
            return False
        return True


def connect(robot_file: RobotFile, _key: bytes, epoch: int) -> MavlinkFollower:
    """Link to the robot of a robot file. A `Connect` of `registry.py`.

    Raises:
        FollowerError: no such host, or its port is taken.
    """
    link = robot_file.link
    if link.mavlink is None:
        raise FollowerError("link.kind = 'mavlink'", "[link.mavlink] in the robot file")
    host = address_of(link.host, "whoever speaks first")
    here = host if host.startswith("127.") else ANYBODY
    end = AutopilotEnd(robot_file, host, link.mavlink, epoch)
    return MavlinkFollower(
        (here, link.port),
        end,
        wants_vision=link.mavlink.vision,
        thrusters=robot_file.robot.A.shape[1],
    )


KIND = LinkKind(connect, stops_in_silence=False, keyed=False, takes=("twist", "attitude"))
