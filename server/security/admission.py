"""Who gets a place at the doors: admission control before TLS, and a limit on strangers' requests.

Three kinds of addresses: *known* ones, from which a request with a role came; this machine's
loopback (*here*); and strangers, who have few places and few handshakes a second. What one kind
does takes nothing from the others. Within a kind, who holds most gives way first.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from typing import Literal, NamedTuple

from starlette.types import Scope

from server.protocol.session import TokenBucket
from server.security.places import AdmissionLimits

Kind = Literal["here", "known", "stranger"]
LOOPBACK = ("127.0.0.1", "::1", "::ffff:127.0.0.1")
PACED_S = 2.0
"""So long waits at most a connection that comes too soon after others: a browser that trusts no
certificate of ours opens thirty for a phone's page, which is dead without one of its files."""
KNOWN_S = 12 * 3600.0
"""An address is known for so long after its last request with a role."""
MAX_KNOWN, MAX_NETWORKS = 64, 1024
"""Addresses, networks remembered; the oldest is forgotten, so that no flood fills memory."""


class RemotePeer(NamedTuple):
    """One connection: the other end, and which of our ports it came to."""

    host: str
    port: int
    door: int


def peer_of(scope: Scope) -> RemotePeer:
    """Remote peer of a request."""
    host, port = scope.get("client") or ("", 0)
    return RemotePeer(host, port, (scope.get("server") or ("", 0))[1])


@dataclass(slots=True, eq=False)
class ConnectionSlot:
    """Slot that a connection holds."""

    peer: RemotePeer
    end: Callable[[], None]
    """Called when somebody else gets this place."""
    group: str
    """Address of the known, network of a stranger."""
    kind: Kind
    wait_s: float = 0.0
    """To be let pass before hands are shaken."""
    has_role: bool = False
    """A request with a role came by it."""

    @property
    def is_known(self) -> bool:
        """Whether it is no stranger's."""
        return self.kind != "stranger"


class Admission:
    """All places of all doors. Not thread-safe: for one event loop."""

    def __init__(self, limits: AdmissionLimits | None = None) -> None:
        """Begin with all slots free."""
        self._limits = limits or AdmissionLimits()
        self._places: dict[RemotePeer, ConnectionSlot] = {}  # oldest first
        self._held: Counter[tuple[Kind, str]] = Counter()
        self._known: OrderedDict[str, float] = OrderedDict()
        self._connections, self._requests = self._shared_buckets()
        self._own: OrderedDict[tuple[Kind, str], tuple[TokenBucket, TokenBucket]] = OrderedDict()
        self.refused = 0
        """Connections without a place, since the start."""

    def __len__(self) -> int:
        return len(self._places)

    @property
    def strangers(self) -> int:
        """Places that strangers hold."""
        return self._held_by("stranger")

    def enter(self, peer: RemotePeer, end: Callable[[], None], now: float) -> ConnectionSlot | None:
        """A place for `peer`, or None; for that another one may be ended."""
        kind, group = self._kind_of(peer.host, now)
        place = ConnectionSlot(peer, end, group, kind, self._wait_of(kind, group, now))
        if place.wait_s > PACED_S or not self._make_room(place):
            self.refused += 1
            return None
        self._places[peer] = place
        self._held[kind, group] += 1
        return place

    def leave(self, place: ConnectionSlot) -> None:
        """Free a slot."""
        if self._places.get(place.peer) is place:
            del self._places[place.peer]
            self._count_out(place)

    def may_ask(self, peer: RemotePeer, has_role: bool, now: float) -> bool:
        """Whether to answer, by what strangers ask; with a role, its address is known then.

        A connection on which too much is asked is ended. What others may ask `quotas` says.
        """
        if has_role:
            self._make_known(peer, now)
        if has_role or self.is_known(peer.host, now):
            return True
        _, own = self._buckets_of("stranger", network_of(peer.host))
        if own.take(now) and self._requests.take(now):
            return True
        place = self._places.get(peer)
        if place is not None:
            self._end(place)
        return False

    def is_known(self, host: str, now: float) -> bool:
        """Whether places are kept for it."""
        return host in LOOPBACK or now - self._known.get(host, -KNOWN_S) < KNOWN_S

    def _kind_of(self, host: str, now: float) -> tuple[Kind, str]:
        """Kind of a peer, with the name of its group."""
        if host in LOOPBACK:
            return "here", ""
        return ("known", host) if self.is_known(host, now) else ("stranger", network_of(host))

    def forget(self, host: str) -> None:
        """Keep no places for an address any more."""
        self._known.pop(host, None)

    def end_a_stranger(self) -> None:
        """End the oldest of them: there are no file handles left."""
        oldest = next((p for p in self._places.values() if not p.is_known), None)
        if oldest is not None:
            self._end(oldest)

    def _end(self, place: ConnectionSlot) -> None:
        self.leave(place)
        place.end()

    def _make_room(self, place: ConnectionSlot) -> bool:
        """Whether there is a place, if need be after another one was ended."""
        own, all_held = self._held[place.kind, place.group], self._held_by(place.kind)
        own_limit, limit = self._places_for(place.kind)
        former = self._places.get(place.peer)
        if former is not None:  # its other end must have forgotten it
            self._end(former)
            return True
        if own < own_limit and all_held < limit:
            return True
        displaced = None
        if own >= own_limit and place.is_known:  # a phone that comes anew leaves dead ones behind
            displaced = self._oldest(place.kind, place.group)
        elif own < own_limit:
            displaced = self._oldest_of_most(place.kind, own)
        if displaced is not None:
            self._end(displaced)
        return displaced is not None

    def _places_for(self, kind: Kind) -> tuple[int, int]:
        """Slots of one group, and of all."""
        limits = self._limits
        if kind == "here":
            return limits.here, limits.here
        if kind == "known":
            return limits.per_known, limits.known
        return limits.per_stranger, limits.strangers

    def _held_by(self, kind: Kind) -> int:
        return sum(n for (of, _), n in self._held.items() if of == kind)

    def _oldest_of_most(self, kind: Kind, own: int) -> ConnectionSlot | None:
        """The oldest place of the group that holds most, if that is more than `own` and one."""
        groups = ((n, group) for (of, group), n in self._held.items() if of == kind)
        most, group = max(groups, default=(0, ""))
        return self._oldest(kind, group) if most > own + 1 else None

    def _oldest(self, kind: Kind, group: str) -> ConnectionSlot | None:
        """Oldest slot of those that have not shown a role."""
        places = (p for p in self._places.values() if (p.kind, p.group) == (kind, group))
        return next((place for place in places if not place.has_role), None)

    def _make_known(self, peer: RemotePeer, now: float) -> None:
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
                one.kind, one.group = "known", peer.host
                self._held[one.kind, one.group] += 1

    def _count_out(self, place: ConnectionSlot) -> None:
        key = place.kind, place.group
        self._held[key] -= 1
        if not self._held[key]:
            del self._held[key]

    def _wait_of(self, kind: Kind, group: str, now: float) -> float:
        """How long a connection that comes now has to wait [s]; beyond `PACED_S` for nothing."""
        own, _ = self._buckets_of(kind, group)
        wait_s = own.wait(now, PACED_S)
        if kind == "stranger" and wait_s <= PACED_S:
            wait_s = max(wait_s, self._connections.wait(now, PACED_S))
        return wait_s

    def _shared_buckets(self) -> tuple[TokenBucket, TokenBucket]:
        limits = self._limits
        rates = (limits.connections_hz, limits.requests_hz)
        connections, requests = (TokenBucket(rate, rate * limits.burst_s) for rate in rates)
        return connections, requests

    def _buckets_of(self, kind: Kind, group: str) -> tuple[TokenBucket, TokenBucket]:
        """(connections, requests) of a group; who is new has full ones."""
        key, limits = (kind, group), self._limits
        if key not in self._own:
            rates = (
                {
                    "here": limits.here_connections_hz,
                    "known": limits.per_known_connections_hz,
                    "stranger": limits.per_stranger_connections_hz,
                }[kind],
                limits.per_stranger_requests_hz,
            )
            connections, requests = (TokenBucket(rate, rate * limits.burst_s) for rate in rates)
            self._own[key] = connections, requests
            if len(self._own) > MAX_NETWORKS:
                self._own.popitem(last=False)
        self._own.move_to_end(key)
        return self._own[key]


def network_of(host: str) -> str:
    """Network of one stranger: an IPv4 address, or 64 bits of IPv6."""
    try:
        address = ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if not isinstance(address, IPv6Address):
        return host
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return ":".join(address.exploded.split(":")[:4])
