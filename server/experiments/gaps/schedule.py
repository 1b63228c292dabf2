"""When a link is dark, and what becomes of what is sent meanwhile: by each way, pure."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from math import floor
from typing import Final

from server.simulation.line import Kind

KEY_S: Final = 0.100
"""By WebRTC a picture after lost ones can be decoded only once a key picture was asked for: two
round trips of waiting, one of asking, and the picture's own way."""
ROUND_TRIP_S: Final = 0.020
RETRANSMIT_S: Final = 0.220
"""The first retransmission of TCP over a near line; each next one waits twice as long (RFC 6298,
with Linux' least of 200 ms)."""


@dataclass(frozen=True, slots=True)
class GapSchedule:
    """So long, so often."""

    gap_s: float
    every_s: float
    first_s: float
    """When the first one begins."""

    def at(self, t: float) -> tuple[float, float] | None:
        """The gap whose period `t` [s] is in: from when to when; None before the first."""
        number = floor((t - self.first_s) / self.every_s)
        if number < 0 or self.gap_s <= 0.0:
            return None
        begin = self.first_s + number * self.every_s
        return begin, begin + self.gap_s

    def dark(self, t: float) -> bool:
        """Whether nothing crosses at `t` [s]."""
        gap = self.at(t)
        return gap is not None and t < gap[1]


@dataclass(frozen=True, slots=True)
class WebRtcLine:
    """Unordered and never sent again: what is sent in a gap is lost."""

    gaps: GapSchedule

    def out(self, t: float, kind: Kind) -> float | None:
        """See `PhoneLine`."""
        gap = self.gaps.at(t)
        if gap is None:
            return t
        dark_s = KEY_S if kind == "picture" else 0.0
        return None if t < gap[1] + dark_s else t


@dataclass(frozen=True, slots=True)
class WebSocketLine:
    """Ordered and sent until it is heard: what a gap holds back comes at once, and late."""

    gaps: GapSchedule

    def out(self, t: float, _: Kind) -> float | None:
        """See `PhoneLine`."""
        gap = self.gaps.at(t)
        return t if gap is None else max(t, heard_again(*gap))


def heard_again(begin: float, end: float) -> float:
    """When TCP's peer has all that was sent in a gap [s].

    A gap shorter than the first time-out is mended a round trip after its end, as the next segment
    tells of the hole. A longer one ends with the first retransmission that falls behind it.
    """
    if end - begin <= RETRANSMIT_S:
        return end + ROUND_TRIP_S
    tried, wait = begin + RETRANSMIT_S, RETRANSMIT_S
    while tried < end:
        wait *= 2.0
        tried += wait
    return tried + 0.5 * ROUND_TRIP_S


Segment = tuple[float, float, float]
"""What is sent from when until when comes out when [s]."""


class TraceLine:
    """A recorded radio: it keeps what it can't send, and lets it through in order. Repeats."""

    def __init__(
        self, up: list[Segment], down: list[Segment], length_s: float, begin_s: float
    ) -> None:
        """Segments by time, without overlap, within `length_s`; clean before `begin_s`."""
        self._segments = {True: up, False: down}
        self._begins = {True: [s[0] for s in up], False: [s[0] for s in down]}
        self._length_s, self._begin_s = length_s, begin_s

    def out(self, t: float, kind: Kind) -> float | None:
        """See `PhoneLine`."""
        if t < self._begin_s:
            return t
        rounds = floor((t - self._begin_s) / self._length_s)
        start = self._begin_s + rounds * self._length_s
        is_up, within = kind != "ping", t - start
        k = bisect_right(self._begins[is_up], within) - 1
        if k < 0:
            return t
        _, until, out = self._segments[is_up][k]
        return start + out if within < until else t
