"""What followers have in common that are a socket, or a topic, before an end without one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from hardware.follower import (
    BlinkOrder,
    BodySample,
    FollowerError,
    RobotCommand,
    RobotHealth,
)
from hardware.link.control_end import ControlEnd

STOP_REPEATS = 5
"""Nobody hears whether it has come: on a line that loses half, one in 32 is not heard."""


class FollowerEnd(Protocol):
    """Control's end of a link, sans-I/O."""

    @property
    def epoch(self) -> int:
        """See `LinkFollower`."""

    @property
    def dropped(self) -> int:
        """See `LinkFollower`."""

    def zero(self) -> RobotCommand:
        """Nothing, disarmed."""


End = TypeVar("End", bound=FollowerEnd)


class LinkFollower(ABC, Generic[End]):
    """A `Follower`, but for how it sends, receives and closes."""

    def __init__(self, end: End, clock: Callable[[], float]) -> None:
        """Open; `clock` is monotonic [s]."""
        self._end, self._clock = end, clock
        self._closed = False
        self.lost = 0
        """Commands known to have gone nowhere: nobody listens, or the way is down or full."""

    @property
    def epoch(self) -> int:
        """Under which commands are sent; a new one after the robot has gone to zero by itself."""
        return self._end.epoch

    @property
    def dropped(self) -> int:
        """What was not the robot's, damaged, repeated, overtaken or of an earlier session."""
        return self._end.dropped

    def send(self, command: RobotCommand) -> None:
        """See `Follower`."""
        self._check_open()
        self._send(command)

    def stop(self) -> None:
        """Zero, several times."""
        for _ in range(0 if self._closed else STOP_REPEATS):
            self._send(self._end.zero())

    def _check_open(self) -> None:
        if self._closed:
            raise FollowerError("the link is closed", "an open one")

    @abstractmethod
    def _send(self, command: RobotCommand) -> None:
        """Send it, or count it as `lost`."""


class DatagramFollower(LinkFollower[ControlEnd]):
    """One by our own link, but for how datagrams go and come."""

    def __init__(self, end: ControlEnd, clock: Callable[[], float]) -> None:
        """Open."""
        super().__init__(end, clock)
        self.thrusters = end.thrusters

    @property
    def health(self) -> tuple[RobotHealth, float] | None:
        """See `TellsHealth`."""
        return self._end.health

    def receive(self) -> list[BodySample]:
        """Return what has arrived. See `Follower`."""
        self._check_open()
        samples = (self._end.receive(data, self._clock()) for data in self._arrived())
        return [sample for sample in samples if sample is not None]

    def blink(self, order: BlinkOrder) -> None:
        """See `Blinking`."""
        self._check_open()
        self._post(self._end.blink(order))

    def use_tool(self, opening: float) -> None:
        """See `HasTool`."""
        self._check_open()
        self._post(self._end.tool(opening))

    def _send(self, command: RobotCommand) -> None:
        self._post(self._end.command(command, self._clock()))

    @abstractmethod
    def _post(self, data: bytes) -> None:
        """Send a datagram, or count it as `lost`."""

    @abstractmethod
    def _arrived(self) -> list[bytes]:
        """Take what has come."""
