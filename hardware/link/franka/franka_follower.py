"""An arm of Franka's: `[link] kind = "franka"`, registered as other packages register theirs."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from hardware.follower import BodySample, FollowerError, RobotCommand, RobotHealth
from hardware.link.franka.arm_end import ArmEnd, ArmLimits, HeardArm, ToldArm
from hardware.link.link_follower import LinkFollower
from hardware.link.registry import LinkKind
from hardware.robot_file import RobotFile

MISSING = "`pip install 'lightleash[franka]'`, where franky has a wheel: docs/franka.md"


class LineToArm(Protocol):
    """A way to the arm; nothing of it waits."""

    def heard(self) -> HeardArm | None:
        """The newest that the arm has said, once."""

    def tell(self, told: ToldArm) -> bool:
        """Hand that over; False: there is no arm."""

    def close(self) -> None:
        """Brake, then leave the arm."""


class FrankaFollower(LinkFollower[ArmEnd]):
    """An arm behind its vendor's library."""

    thrusters = 0

    def __init__(
        self, line: LineToArm, end: ArmEnd, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Ready; says nothing yet."""
        super().__init__(end, clock)
        self._line = line

    @property
    def health(self) -> tuple[RobotHealth, float] | None:
        """See `TellsHealth`."""
        return self._end.health

    def receive(self) -> list[BodySample]:
        """Return what has arrived. See `Follower`."""
        self._check_open()
        if (heard := self._line.heard()) is not None:
            self._end.hear(heard)
        sample = self._end.beat(self._clock())
        return [] if sample is None else [sample]

    def close(self) -> None:
        """Close. See `Follower`.

        Not without a word: an arm carries itself, and nothing falls by zero.
        """
        self.stop()
        self._closed = True
        self._line.close()

    def _send(self, command: RobotCommand) -> None:
        self.lost += not self._line.tell(self._end.command(command, self._clock()))


def connect(robot_file: RobotFile, _key: bytes, epoch: int) -> FrankaFollower:
    """Link to the robot of a robot file. A `Connect` of `registry.py`.

    An arm that is not there, or refuses, is tried again each second, and the log says why.

    Raises:
        FollowerError: no franky on this machine, or a robot file for another link.
    """
    try:
        from hardware.link.franka.arm_line import ArmLine
    except ImportError as error:
        raise FollowerError(f"link.kind = 'franka': {error}", MISSING) from error
    mount, drive = robot_file.link.franka, robot_file.robot.twist
    if mount is None or drive is None:
        raise FollowerError("link.kind = 'franka'", "[link.franka] in the robot file")
    limits = ArmLimits.of(drive, mount)
    line = ArmLine(robot_file.link.host, limits, real_time=mount.real_time)
    return FrankaFollower(line, ArmEnd(robot_file, mount, epoch))


KIND = LinkKind(connect, stops_in_silence=False, keyed=False, takes=("twist",))
