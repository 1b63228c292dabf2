"""Jitter buffer: assembles RTP packets into frames, which leave it with their last packet.

In the shape of aiortc's own `JitterBuffer`, which keeps every picture until the next one begins
and, after a loss, all of them until 512 packets have come. Sans-I/O.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from server.protocol.wire import MAX_RECORD_BYTES
from server.rtc.receiving.rtp import NUMBER_BITS, ahead

CAPACITY = 2048
"""Packets; one further ahead, or as far behind, is of another stream."""
ASK_AGAIN_S = 0.3
"""Between requests for a key frame while pictures come that can't be used."""


class Packet(Protocol):
    """An RTP packet as aiortc has taken it apart."""

    sequence_number: int
    timestamp: int
    marker: int
    payload_type: int
    _data: bytes
    """Of the picture; empty in packets that only fill the line."""


@dataclass(frozen=True, slots=True)
class Assembled:
    """A whole encoded picture."""

    data: bytes
    payload_type: int
    timestamp: int
    """RTP's, 90 kHz."""
    key: bool
    number: int
    """Consecutive, with a gap where pictures were lost."""


class JitterBuffer:
    """Holds what came out of order; gives up what does not come in time."""

    def __init__(
        self,
        is_key: Callable[[int, bytes], bool],
        on_frame: Callable[[Assembled], None],
        clock: Callable[[], float],
        patience: Callable[[], float],
    ) -> None:
        """`is_key(payload type, first bytes)`; a hole may last `patience()` [s]."""
        self._is_key, self._on_frame = is_key, on_frame
        self._clock, self._patience = clock, patience
        self._waiting: dict[int, tuple[Packet, float]] = {}
        """Beyond a hole, with their arrival; numbered without wrapping."""
        self._next: int | None = None
        self._parts: list[Packet] = []
        self._size = 0
        self._skipped_timestamp: int | None = None
        """Of a picture whose beginning is lost."""
        self._number, self._has_gap = 0, False
        self._t_ask = -float("inf")
        self.needs_key = True
        """Pictures are of no use before a key frame."""
        self.dropped = self.given_up = self.restarts = 0
        """Pictures that leant on a lost one; holes not waited for; streams begun anew."""

    def add(self, packet: Packet) -> tuple[bool, None]:
        """Take a packet; (whether to ask for a key frame, nothing: pictures go to `on_frame`)."""
        now = self._clock()
        position = self._position(packet.sequence_number)
        assert self._next is not None
        if not -CAPACITY < position - self._next < CAPACITY:
            self._restart(position)
        if position >= self._next:
            self._waiting.setdefault(position, (packet, now))
            self._advance()
        return self.poll(now), None

    def poll(self, now: float) -> bool:
        """Give up holes that are too old; whether to ask for a key frame."""
        asks = self.needs_key and self._has_gap and now >= self._t_ask + ASK_AGAIN_S
        while (due := self.due()) is not None and now >= due:
            self._give_up()
            asks = True
        if asks:
            self._t_ask = now
        return asks

    def due(self) -> float | None:
        """When the oldest hole is too old [s]; None without a hole."""
        if not self._waiting:
            return None
        return min(arrived for _, arrived in self._waiting.values()) + self._patience()

    def _position(self, sequence_number: int) -> int:
        if self._next is None:
            self._next = sequence_number
        return self._next + ahead(sequence_number, self._next, NUMBER_BITS)

    def _restart(self, position: int) -> None:
        self.restarts += 1
        self._waiting.clear()
        self._next = position
        self._lose_picture()
        self._t_ask = -float("inf")

    def _advance(self) -> None:
        assert self._next is not None
        while (entry := self._waiting.pop(self._next, None)) is not None:
            self._next += 1
            self._take(entry[0])

    def _give_up(self) -> None:
        """Go on behind the hole, where a picture begins."""
        self.given_up += 1
        self._lose_picture()
        self._next = min(self._waiting)
        first = self._waiting[self._next][0]
        if not self._is_key(first.payload_type, first._data):
            self._skipped_timestamp = first.timestamp
        self._advance()

    def _lose_picture(self) -> None:
        self._forget_parts()
        self._skipped_timestamp = None
        self.needs_key = self._has_gap = True

    def _forget_parts(self) -> None:
        self._parts, self._size = [], 0

    def _take(self, packet: Packet) -> None:
        """The next packet in order."""
        if not packet._data or packet.timestamp == self._skipped_timestamp:
            return
        self._skipped_timestamp = None
        if self._parts and packet.timestamp != self._parts[0].timestamp:
            self._release()  # its last packet had no mark
        self._parts.append(packet)
        self._size += len(packet._data)
        if self._size > MAX_RECORD_BYTES or len(self._parts) > CAPACITY:
            self._lose_picture()
            self._skipped_timestamp = packet.timestamp
        elif packet.marker:
            self._release()

    def _release(self) -> None:
        first, data = self._parts[0], b"".join(part._data for part in self._parts)
        self._forget_parts()
        key = self._is_key(first.payload_type, data)
        if self.needs_key and not key:
            self.dropped += 1
            self._has_gap = True
            return
        self._number += 2 if self._has_gap else 1
        self.needs_key = self._has_gap = False
        self._on_frame(Assembled(data, first.payload_type, first.timestamp, key, self._number))
