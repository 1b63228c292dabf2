"""Which lost packets to ask for, and again after each round trip, until nobody waits for them.

In the shape of aiortc's own `NackGenerator`, which asks again only when another packet is lost.
Sans-I/O.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from server.rtc.receiving.rtp import NUMBER_BITS, ahead

MAX_MISSING = 512
"""More at once is another stream, or a line that is no use asking on."""
CLOSEST_S = 0.01
"""Between two requests for one packet."""


class Numbered(Protocol):
    """An RTP packet."""

    sequence_number: int


class _Lost:
    """One lost packet."""

    __slots__ = ("asked", "since")

    def __init__(self, now: float) -> None:
        self.since, self.asked = now, -float("inf")


class NackGenerator:
    """Follows the numbers of packets."""

    def __init__(
        self,
        clock: Callable[[], float],
        round_trip: Callable[[], float],
        patience: Callable[[], float],
    ) -> None:
        """A packet is asked for once in a `round_trip()`, for `patience()` [s]."""
        self._clock, self._round_trip, self._patience = clock, round_trip, patience
        self._lost: dict[int, _Lost] = {}
        self._newest: int | None = None
        self.missing: set[int] = set()
        """To be asked for now."""

    def add(self, packet: Numbered) -> bool:
        """Take a packet's number; whether some are `missing`."""
        number, now = packet.sequence_number, self._clock()
        if self._newest is None:
            self._newest = number
        steps = ahead(number, self._newest, NUMBER_BITS)
        if steps > 0:
            self._miss(self._newest, steps, now)
            self._newest = number
        else:
            self._lost.pop(number, None)
        self.missing = self.take_due(now)
        return bool(self.missing)

    def take_due(self, now: float) -> set[int]:
        """Take the packets to ask for now; they count as asked for."""
        patience, pause = self._patience(), max(CLOSEST_S, self._round_trip())
        self._lost = {n: one for n, one in self._lost.items() if now < one.since + patience}
        due = {n for n, one in self._lost.items() if now >= one.asked + pause}
        for number in due:
            self._lost[number].asked = now
        return due

    def due(self) -> float | None:
        """When there is something to ask for again [s]; None if nothing is lost."""
        if not self._lost:
            return None
        return min(one.asked for one in self._lost.values()) + max(CLOSEST_S, self._round_trip())

    def _miss(self, newest: int, steps: int, now: float) -> None:
        if len(self._lost) + steps > MAX_MISSING:
            self._lost.clear()
            return
        for step in range(1, steps):
            self._lost[newest + step & 0xFFFF] = _Lost(now)
