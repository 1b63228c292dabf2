"""A bad line, one direction of it: packets go in, and come out late, twice, spoilt or not at all.

Pure: times are arguments, chance comes from a seed. Each packet draws the same few numbers whatever
the conditions are, so a packet that a line loses is also lost by a worse line with the same seed.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from heapq import heappop, heappush
from math import isfinite
from typing import NamedTuple

import numpy as np

UDP = 17  # IP's number of it
UDP_HEADER_BYTES = 8
Taken = tuple[float, bytes]
"""When it comes out [s], packet."""


class ConditionsError(ValueError):
    """Conditions that no line has.

    Attributes:
        name: Of the condition.
        allowed: What would have been allowed.
    """

    def __init__(self, name: str, value: object, allowed: str) -> None:
        super().__init__(f"{name}: {value!r}; allowed: {allowed}")
        self.name, self.allowed = name, allowed


@dataclass(frozen=True, slots=True)
class Burst:
    """A line that is good or bad for a while (Gilbert 1960, Elliott 1963)."""

    enter: float
    """Chance, with each packet, that a good line turns bad."""
    leave: float
    """That a bad one turns good."""
    loss: float
    """Of a packet on the bad one."""

    def __post_init__(self) -> None:
        _check_chances(self)


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a line does to its packets; by default nothing."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    """At most so much later, evenly spread; nothing overtakes by it."""
    loss: float = 0.0
    """Share of the packets."""
    burst: Burst | None = None
    reorder: float = 0.0
    """Share that is held back, so that later ones overtake."""
    hold_s: float = 0.02
    """For how long."""
    duplicate: float = 0.0
    """Share that comes twice."""
    corrupt: float = 0.0
    """Share with one bit turned."""
    rate_bps: float = float("inf")
    bucket_bytes: int = 3_000
    """That may go at once after a pause."""
    queue_bytes: int = 65_536
    """That may wait for the rate; more is dropped."""
    dark: bool = False
    """Blackout: all that is put in is lost."""

    def __post_init__(self) -> None:
        _check_chances(self)
        for name in ("delay_s", "jitter_s", "hold_s"):
            value = getattr(self, name)
            if not (isfinite(value) and 0.0 <= value <= 10.0):
                raise ConditionsError(name, value, "0 to 10 s")
        if not self.rate_bps >= 1e3:
            raise ConditionsError("rate_bps", self.rate_bps, "from 1000")
        for name in ("bucket_bytes", "queue_bytes"):
            if getattr(self, name) < 1_500:
                raise ConditionsError(name, getattr(self, name), "from 1500: one packet")


CHANCES = ("enter", "leave", "loss", "reorder", "duplicate", "corrupt")


def _check_chances(conditions: Conditions | Burst) -> None:
    names = {field.name for field in fields(conditions)}
    for name in names.intersection(CHANCES):
        if not 0.0 <= getattr(conditions, name) <= 1.0:
            raise ConditionsError(name, getattr(conditions, name), "0 to 1")


CLEAN = Conditions()


@dataclass(slots=True)
class Counts:
    """What a line has done so far; packets, where nothing else is said."""

    put: int = 0
    put_bytes: int = 0
    came: int = 0
    """Out, twins too."""
    came_bytes: int = 0
    lost: int = 0
    burst_lost: int = 0
    dark_lost: int = 0
    overflowed: int = 0
    """Dropped because the queue was full."""
    held_back: int = 0
    duplicated: int = 0
    corrupted: int = 0
    longest_queue_bytes: int = 0


class _Chance(NamedTuple):
    """Random numbers for one packet, each in [0, 1)."""

    loss: float
    turn: float
    burst_loss: float
    reorder: float
    duplicate: float
    corrupt: float
    jitter: float
    place: float


class ChannelEmulator:
    """One direction. Put packets in, in the order of time; take out what is due."""

    def __init__(
        self, conditions: Conditions = CLEAN, seed: int | np.random.SeedSequence = 0
    ) -> None:
        """`conditions` may be changed at any time; packets on their way don't notice."""
        self.conditions = conditions
        self._rng = np.random.default_rng(seed)
        self._way: list[tuple[float, int, bytes]] = []
        self._count = 0
        self._is_bad = False
        self._free = -float("inf")
        """When the rate has given way to all that was put in, the bucket not counted."""
        self._last = -float("inf")
        self._counts = Counts()

    @property
    def counts(self) -> Counts:
        """Counts so far."""
        return replace(self._counts)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is on its way."""
        return not self._way

    def put(self, t: float, packet: bytes) -> None:
        """A packet enters at `t` [s]."""
        now, counts = self.conditions, self._counts
        chance = _Chance(*self._rng.random(len(_Chance._fields)).tolist())
        counts.put += 1
        counts.put_bytes += len(packet)
        if self._is_lost(now, chance):
            return
        t_through = self._through(t, len(packet), now)
        if t_through is None:
            counts.overflowed += 1
            return
        if chance.corrupt < now.corrupt:
            counts.corrupted += 1
            packet = spoilt(packet, chance.place)
        t_out = max(self._last, t_through + now.delay_s + chance.jitter * now.jitter_s)
        if chance.reorder < now.reorder:
            counts.held_back += 1
            t_out += now.hold_s
        else:
            self._last = t_out
        copies = 1 + (chance.duplicate < now.duplicate)
        counts.duplicated += copies - 1
        for _ in range(copies):
            self._count += 1
            heappush(self._way, (t_out, self._count, packet))

    def due(self) -> float | None:
        """When the next packet comes out [s]; None if none is on its way."""
        return self._way[0][0] if self._way else None

    def take(self, t: float) -> list[Taken]:
        """Take out what is due by `t` [s], in order of time; each packet once."""
        taken: list[Taken] = []
        while self._way and self._way[0][0] <= t:
            t_out, _, packet = heappop(self._way)
            taken.append((t_out, packet))
            self._counts.came += 1
            self._counts.came_bytes += len(packet)
        return taken

    def _is_lost(self, now: Conditions, chance: _Chance) -> bool:
        burst, counts = now.burst, self._counts
        if burst is not None:
            self._is_bad = chance.turn >= burst.leave if self._is_bad else chance.turn < burst.enter
        if now.dark:
            counts.dark_lost += 1
            return True
        if chance.loss < now.loss:
            counts.lost += 1
            return True
        if burst is not None and self._is_bad and chance.burst_loss < burst.loss:
            counts.burst_lost += 1
            return True
        return False

    def _through(self, t: float, size: int, now: Conditions) -> float | None:
        """When the token bucket lets a packet go [s]; None if the queue is full."""
        if not isfinite(now.rate_bps):
            self._free = min(self._free, t)
            return t
        bytes_per_s = now.rate_bps / 8.0
        queued = max(0.0, self._free - t) * bytes_per_s
        if queued + size > now.queue_bytes:
            return None
        bucket_s = now.bucket_bytes / bytes_per_s
        self._free = max(self._free, t - bucket_s) + size / bytes_per_s
        waiting = round(max(0.0, self._free - t) * bytes_per_s)
        self._counts.longest_queue_bytes = max(self._counts.longest_queue_bytes, waiting)
        return max(t, self._free)


def spoilt(packet: bytes, place: float) -> bytes:
    """A packet with one bit turned behind its IPv4 header, `place` in [0, 1) of the way.

    In a UDP datagram the payload is hit and the checksum is taken away (RFC 768: 0 is none), so
    that the damage reaches the program and not only the kernel, which would drop it.
    """
    damaged = bytearray(packet)
    begin = 4 * (packet[0] & 15) if packet else 0
    is_udp = len(packet) >= begin + UDP_HEADER_BYTES and packet[9:10] == bytes([UDP])
    if is_udp:
        damaged[begin + 6 : begin + UDP_HEADER_BYTES] = bytes(2)
        begin += UDP_HEADER_BYTES
    bits = 8 * (len(packet) - begin)
    if bits > 0:
        bit = int(place * bits)
        damaged[begin + bit // 8] ^= 1 << bit % 8
    return bytes(damaged)
