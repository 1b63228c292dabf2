"""What is on its way between phone and server in virtual time, and the line that it goes by."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from typing import Literal, Protocol

Kind = Literal["motion", "picture", "touch", "ping", "pong"]
"""What is sent; a ping goes to the phone, all else comes from it."""


class PhoneLine(Protocol):
    """What a phone's line does beyond the usual delays."""

    def out(self, t: float, kind: Kind) -> float | None:
        """When what comes at `t` [s] is let through [s], not before `t`; None: it is lost."""


class CleanLine:
    """Lets everything through at once."""

    def out(self, t: float, _: Kind) -> float | None:
        """See `PhoneLine`."""
        return t


class Transit:
    """Keeps what a line holds back; may be given another line at any time."""

    def __init__(self) -> None:
        """Begin with nothing on its way."""
        self.line: PhoneLine = CleanLine()
        self.lost = 0
        """Of what was sent."""
        self._waiting: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0

    def send(self, t: float, kind: Kind, deliver: Callable[[], None]) -> None:
        """Send something at `t` [s]; `deliver` is called when the line has let it through."""
        t_out = self.line.out(t, kind)
        if t_out is None:
            self.lost += 1
            return
        self._count += 1
        heappush(self._waiting, (max(t, t_out), self._count, deliver))

    def deliver(self, t: float) -> None:
        """Deliver all that is through by `t` [s]: by time, then in the order of sending."""
        while self._waiting and self._waiting[0][0] <= t:
            heappop(self._waiting)[2]()
