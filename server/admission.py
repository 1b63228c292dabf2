"""Who gets a place at the doors: admission control before TLS, and a limit on strangers' requests.

Three kinds of addresses: *known* ones, from which a request with a role came; this machine's
loopback, known by nature; and strangers, who have few places and few handshakes a second. What
strangers do takes nothing from the others. Within a kind, who holds most gives way first.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from typing import NamedTuple

from starlette.types import Scope

from server.session import Bucket

LOOPBACK = ("127.0.0.1", "::1", "::ffff:127.0.0.1")
KNOWN_S = 12 * 3600.0
"""An address is known for so long after its last request with a role."""
MAX_KNOWN, MAX_NETWORKS = 64, 1024
OWN_HANDLES = 192
"""File handles that the process keeps for itself: libraries, recordings, datagrams."""


class Peer(NamedTuple):
    """One connection: the other end, and which of our ports it came to."""

    host: str
    port: int
    door: int


def peer_of(scope: Scope) -> Peer:
    """Who asks."""
    host, port = scope.get("client") or ("", 0)
    return Peer(host, port, (scope.get("server") or ("", 0))[1])


@dataclass(frozen=True, slots=True)
class Limits:
    """Places, and rates with what may come at once."""

    strangers: int = 64
    per_stranger: int = 16
    known: int = 192
    per_known: int = 64
    connections_hz: float = 32.0
    """Of all strangers: a TLS handshake costs a millisecond or two of the event loop."""
    per_stranger_connections_hz: float = 8.0
    requests_hz: float = 100.0
    """Of all strangers; the pages are some sixty files."""
    per_stranger_requests_hz: float = 40.0
    burst_s: float = 4.0
    """So many seconds' worth may come at once."""


def limits_for(handles: int) -> Limits:
    """Limits that fit in so many file handles: strangers give way first."""
    usual = Limits()
    free = max(handles - OWN_HANDLES, 16)
    known = min(usual.known, free * 3 // 4)
    return Limits(
        strangers=max(4, min(usual.strangers, free - known)),
        per_stranger=max(2, min(usual.per_stranger, (free - known) // 4)),
        known=known,
        per_known=max(8, min(usual.per_known, known // 3)),
    )


@dataclass(slots=True, eq=False)
class Place:
    """What a connection holds."""

    peer: Peer
    end: Callable[[], None]
    """Called when somebody else gets this place."""
    group: str
    """Address of the known, network of a stranger."""
    is_known: bool
    has_role: bool = False
    """A request with a role came by it."""


class Admission:
    """All places of all doors. Not thread-safe: for one event loop."""

    def __init__(self, limits: Limits | None = None) -> None:
        """Empty."""
        self._limits = limits or Limits()
        self._places: dict[Peer, Place] = {}  # oldest first
        self._held: Counter[tuple[bool, str]] = Counter()
        self._known: OrderedDict[str, float] = OrderedDict()
        self._connections, self._requests = self._shared_buckets()
        self._own: OrderedDict[str, tuple[Bucket, Bucket]] = OrderedDict()
        self.refused = 0
        """Connections without a place, since the start."""

    def __len__(self) -> int:
        return len(self._places)

    @property
    def strangers(self) -> int:
        """Places that strangers hold."""
        return sum(not place.is_known for place in self._places.values())

    def enter(self, peer: Peer, end: Callable[[], None], now: float) -> Place | None:
        """A place for `peer`, or None; for that another one may be ended."""
        is_known = self.is_known(peer.host, now)
        group = peer.host if is_known else network_of(peer.host)
        place = Place(peer, end, group, is_known)
        if not (is_known or self._may_connect(group, now)) or not self._make_room(place):
            self.refused += 1
            return None
        self._places[peer] = place
        self._held[is_known, group] += 1
        return place

    def leave(self, place: Place) -> None:
        """It is free again."""
        if self._places.get(place.peer) is place:
            del self._places[place.peer]
            self._count_out(place)

    def may_ask(self, peer: Peer, has_role: bool, now: float) -> bool:
        """Whether to answer a request; one with a role always, and its address is known then.

        A connection on which too much is asked is ended.
        """
        if has_role:
            self._make_known(peer, now)
        if has_role or self.is_known(peer.host, now):
            return True
        _, own = self._buckets_of(network_of(peer.host))
        if own.take(now) and self._requests.take(now):
            return True
        place = self._places.get(peer)
        if place is not None:
            self._end(place)
        return False

    def is_known(self, host: str, now: float) -> bool:
        """Whether places are kept for it."""
        return host in LOOPBACK or now - self._known.get(host, -KNOWN_S) < KNOWN_S

    def forget(self, host: str) -> None:
        """Keep no places for an address any more."""
        self._known.pop(host, None)

    def end_a_stranger(self) -> None:
        """End the oldest of them: there are no file handles left."""
        oldest = next((p for p in self._places.values() if not p.is_known), None)
        if oldest is not None:
            self._end(oldest)

    def _end(self, place: Place) -> None:
        self.leave(place)
        place.end()

    def _make_room(self, place: Place) -> bool:
        """Whether there is a place, if need be after another one was ended."""
        limits, own = self._limits, self._held[place.is_known, place.group]
        if place.is_known:
            own_limit, all_held, limit = limits.per_known, len(self) - self.strangers, limits.known
        else:
            own_limit, all_held, limit = limits.per_stranger, self.strangers, limits.strangers
        former = self._places.get(place.peer)
        if former is not None:  # its other end must have forgotten it
            self._end(former)
            return True
        if own < own_limit and all_held < limit:
            return True
        displaced = None
        if own >= own_limit and place.is_known:  # a phone that comes anew leaves dead ones behind
            displaced = self._oldest(True, place.group)
        elif own < own_limit:
            displaced = self._oldest_of_most(place.is_known, own)
        if displaced is not None:
            self._end(displaced)
        return displaced is not None

    def _oldest_of_most(self, is_known: bool, own: int) -> Place | None:
        """The oldest place of the group that holds most, if that is more than `own` and one."""
        groups = ((n, group) for (kind, group), n in self._held.items() if kind == is_known)
        most, group = max(groups, default=(0, ""))
        return self._oldest(is_known, group) if most > own + 1 else None

    def _oldest(self, is_known: bool, group: str) -> Place | None:
        """Of those that have not shown a role."""
        places = (p for p in self._places.values() if (p.is_known, p.group) == (is_known, group))
        return next((place for place in places if not place.has_role), None)

    def _make_known(self, peer: Peer, now: float) -> None:
        place = self._places.get(peer)
        if place is not None:
            place.has_role = True
        if peer.host in LOOPBACK:
            return
        is_new = peer.host not in self._known
        self._known[peer.host] = now
        self._known.move_to_end(peer.host)
        if len(self._known) > MAX_KNOWN:
            self._known.popitem(last=False)
        if is_new:
            for one in [p for p in self._places.values() if p.peer.host == peer.host]:
                self._count_out(one)
                one.is_known, one.group = True, peer.host
                self._held[True, one.group] += 1

    def _count_out(self, place: Place) -> None:
        key = place.is_known, place.group
        self._held[key] -= 1
        if not self._held[key]:
            del self._held[key]

    def _may_connect(self, network: str, now: float) -> bool:
        own, _ = self._buckets_of(network)
        return own.take(now) and self._connections.take(now)

    def _shared_buckets(self) -> tuple[Bucket, Bucket]:
        limits = self._limits
        rates = (limits.connections_hz, limits.requests_hz)
        connections, requests = (Bucket(rate, rate * limits.burst_s) for rate in rates)
        return connections, requests

    def _buckets_of(self, network: str) -> tuple[Bucket, Bucket]:
        """(connections, requests) of a stranger's network; who is new has full ones."""
        if network not in self._own:
            limits = self._limits
            rates = (limits.per_stranger_connections_hz, limits.per_stranger_requests_hz)
            connections, requests = (Bucket(rate, rate * limits.burst_s) for rate in rates)
            self._own[network] = connections, requests
            if len(self._own) > MAX_NETWORKS:
                self._own.popitem(last=False)
        self._own.move_to_end(network)
        return self._own[network]


def network_of(host: str) -> str:
    """What one stranger has: an IPv4 address, or 64 bits of IPv6."""
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if not isinstance(address, IPv6Address):
        return host
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return ":".join(address.exploded.split(":")[:4])
