"""How much those may ask whom the doors know: members, programs of this machine, known addresses.

Each has a pool of its own, so that none takes anything from another one; strangers share theirs in
`admission`. STOP is counted nowhere. Sans-I/O.
"""

from __future__ import annotations

import contextlib
from collections import Counter, OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from server.protocol.session import TokenBucket

Kind = Literal["member", "program", "loopback", "address"]
MAX_POOLS = 256  # one for each who asks; the oldest is forgotten
COSTS = {
    **dict.fromkeys(("/api/check", "/api/link", "/metrics"), 25.0),
    **dict.fromkeys(("/api/invite", "/view", "/view/"), 10.0),
}
"""What computes for long, or is large, counts for so many requests."""


class Asker(NamedTuple):
    """Whose pool it is: a member's or program's id, or an address without a role."""

    kind: Kind
    name: str


@dataclass(frozen=True, slots=True)
class Quota:
    """Contents of one pool."""

    hz: float
    at_once: float
    under_way: int
    """Requests that are not answered yet."""
    sockets: int
    """Open websockets."""


QUOTAS: dict[Kind, Quota] = {
    "member": Quota(50.0, 400.0, 32, 16),
    "program": Quota(200.0, 800.0, 64, 32),
    "loopback": Quota(200.0, 800.0, 32, 0),
    "address": Quota(40.0, 160.0, 16, 0),
}
"""A page is some sixty files and then asks a few times a second; of sockets it has two."""


class Quotas:
    """All pools. Not thread-safe: for one event loop."""

    def __init__(self, quotas: Mapping[Kind, Quota] = QUOTAS) -> None:
        """Begin full."""
        self._quotas = quotas
        self._buckets: OrderedDict[Asker, TokenBucket] = OrderedDict()
        self._under_way: Counter[tuple[Asker, bool]] = Counter()

    def may_ask(self, asker: Asker | None, path: str, now: float) -> str:
        """Count a request; "", or what would be allowed. `asker` None is counted elsewhere."""
        if asker is None or self._bucket(asker).take(now, COSTS.get(path, 1.0)):
            return ""
        quota = self._quotas[asker.kind]
        return f"{quota.hz:g} a second, {quota.at_once:g} at once: wait a little"

    @contextlib.contextmanager
    def place(self, asker: Asker | None, is_socket: bool) -> Iterator[str]:
        """Count an open websocket or an unanswered request; "", or what would be allowed."""
        if asker is None:
            yield ""
            return
        key, quota = (asker, is_socket), self._quotas[asker.kind]
        limit = quota.sockets if is_socket else quota.under_way
        if self._under_way[key] >= limit:
            yield f"{limit} {'open websockets' if is_socket else 'at a time'}: end one of them"
            return
        self._under_way[key] += 1
        try:
            yield ""
        finally:
            self._under_way[key] -= 1
            if not self._under_way[key]:
                del self._under_way[key]

    def _bucket(self, asker: Asker) -> TokenBucket:
        if asker not in self._buckets:
            quota = self._quotas[asker.kind]
            self._buckets[asker] = TokenBucket(quota.hz, quota.at_once)
            if len(self._buckets) > MAX_POOLS:
                self._buckets.popitem(last=False)
        self._buckets.move_to_end(asker)
        return self._buckets[asker]
