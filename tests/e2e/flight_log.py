"""What a server said during a flight, and what became of the flight."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from pipeline.config import FailsafeConfig
from server.protocol.wire import VERSION
from tests import retries
from tests.e2e.serving import Serving
from tests.e2e.witness import Hole
from tests.machine import overload, own_s

AT_REST = ("DISARMED", "STOPPED", "LOST")
GAP_S = FailsafeConfig().gap
BORNE_S = {"machine": 0.06, "slow": 0.0, "stolen": 0.1, "others": GAP_S, "server": GAP_S}
"""So long a silent robot link and a silent phone are borne; a machine that is slow by control's own
rule is not, nor one whose host took a fifth of a processor in half a second. Of the server only
what it waited for a processor counts. What else has holes may be the product's own doing."""
CAUSE_S = 1.0
"""Between a hole and what it led to."""
SHOWN_S = 0.05
WAITED = "armed_stall_waited_ms"
BY_KERNEL = (WAITED, "recent_stall_waited_ms")
"""What the kernel tells the server of: in the world's time."""
MOST_FLIGHTS = 4
"""Tried for one that is wanted, on a machine that is proven to have been away each time."""
KEPT = ("mode", "reason", "server")
TOLD = ("streams", "estimate", "camera")
"""What a status says of what the robot's place was made from."""


@dataclass(frozen=True, slots=True)
class Said:
    """One status."""

    t: float
    """When it came [s, monotonic]."""
    mode: str
    reason: str
    server: dict[str, float]


class FlightLog:
    """Reads the status as a supervisor's page does, from its own thread."""

    def __init__(self, server: Serving) -> None:
        """Connected."""
        headers = {"Authorization": f"Bearer {server.supervisor_token}"}
        url = f"{server.http_url.replace('http', 'ws')}/ws/supervisor"
        self._page = connect(url, additional_headers=headers, compression=None, proxy=None)
        self._page.send(json.dumps({"type": "hello", "version": VERSION, "role": "supervisor"}))
        self.said: list[Said] = []
        self.newest: dict[str, Any] = {}
        """The last status, whole."""
        self._has_followed = False
        self.is_over = False
        """Whether the robot came down after it had followed."""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for data in self._page:
                if isinstance(data, bytes):
                    continue
                told = json.loads(data)
                if told["type"] == "status":
                    self.newest = told
                    server = told["server"]
                    server |= {name: own_s(server[name]) for name in BY_KERNEL if name in server}
                    self._keep(Said(time.monotonic(), *(told[k] for k in KEPT)))

    def _keep(self, said: Said) -> None:
        self.said.append(said)
        self._has_followed |= said.mode == "TRACK"
        self.is_over = self._has_followed and said.mode in (*AT_REST, "RAMP")

    def request(self, what: str) -> None:
        """Ask for something, as the page's buttons do."""
        self._page.send(json.dumps({"type": "command", "what": what}))

    def close(self) -> None:
        """Leave."""
        self._page.close()
        self._thread.join()


@dataclass(frozen=True, slots=True)
class Flight:
    """One, tried once."""

    planned_s: float
    distances: list[tuple[float, float]]
    """As `PlayedPhone.track` gives them."""
    status: dict[str, object]
    """At its end."""
    said: list[Said]
    holes: list[Hole] = field(default_factory=list)
    never: str = ""
    """Why it did not begin."""
    taps: int = 1
    """On Arm, until it was granted."""
    slowness: float = 1.0
    """Of the machine, told in the account; by itself it excuses nothing."""
    spare: float = 1.0
    """Share of its processors' time that nobody wanted meanwhile."""
    missed: str = ""
    """Which bounds, though it reached its end."""

    @property
    def ended(self) -> str:
        """Why it did not reach the end, or ""."""
        if self.never:
            return f"never led: {self.never}"
        return "" if self.status["mode"] == "TRACK" else str(self.status["reason"])

    @property
    def following(self) -> float:
        """Share of the planned time in which the robot followed."""
        tracked = sum(
            after.t - before.t for before, after in pairwise(self.said) if before.mode == "TRACK"
        )
        return min(1.0, tracked / self.planned_s)

    @property
    def starved(self) -> list[Hole]:
        """When the server, in its own words, was longer without a processor than ever before."""
        told = [(said.t, 1e-3 * said.server.get(WAITED, 0.0)) for said in self.said]
        grown = pairwise(told)
        return [Hole("server", t, s) for (_, before), (t, s) in grown if s > before]

    @property
    def excuse(self) -> list[Hole]:
        """Holes that prove that the machine was away longer than is borne.

        Where it was ended; anywhere since it followed, if it reached its end and missed a bound.
        """
        followed = [said.t for said in self.said if said.mode == "TRACK"]
        left = followed[-1] if followed else (self.said[-1].t if self.said else 0.0)
        since = followed[0] if self.missed and not self.ended else left - CAUSE_S
        return [
            hole
            for hole in (*self.holes, *self.starved)
            if hole.s >= BORNE_S.get(hole.where, float("inf")) and since <= hole.t <= left + CAUSE_S
        ]

    @property
    def proofs(self) -> list[str]:
        """That the machine was away, or asked for more than it has; empty: it was there."""
        return [*map(str, self.excuse), *filter(None, [overload(self.slowness, self.spare)])]

    def account(self) -> str:
        """What happened, in lines."""
        lines = [
            f"{self.ended or self.missed or 'to the end'}; followed {100 * self.following:.1f} %"
        ]
        if self.taps > 1:
            lines.append(f"  armed by tap {self.taps}")
        lines.append(
            f"  work takes {self.slowness:.1f} times as long as where bounds were measured;"
            f" {100.0 * self.spare:.0f} % of the processors' time was left"
        )
        began, mode = self.said[0].t if self.said else 0.0, ""
        for said in self.said:
            if said.mode != mode:
                lines.append(f"  {said.t - began:6.1f} s {said.mode}: {said.reason}")
                mode = said.mode
        if self.said:
            lines.append(f"  the server's pauses: {self.said[-1].server}")
        lines += [f"  {what}: {self.status[what]}" for what in TOLD if what in self.status]
        shown = [hole for hole in (*self.holes, *self.starved) if hole.s >= SHOWN_S]
        lines += [
            f"  {hole.t - began:6.1f} s {hole.where} away for {1e3 * hole.s:.0f} ms"
            for hole in sorted(shown, key=lambda hole: hole.t)
        ]
        return "\n".join(lines)


def to_its_end(
    fly: Callable[[], Flight],
    let_go: Callable[[], object],
    misses: Callable[[Flight], str] = lambda _: "",
) -> Flight:
    """The first flight that reaches its end, again as long as the machine was proven to be away.

    So it was if it is weak and had no processor left (`overload`).

    `misses` says which bounds one missed that reached it, or "": it is no more excused.

    Raises:
        AssertionError: one did not, and the machine was there; or it was away too often.
    """
    retries.may_follow()
    for left in reversed(range(MOST_FLIGHTS)):
        one = fly()
        if not one.ended:
            one = replace(one, missed=misses(one))
            if not one.missed:
                return one
        print(one.account())
        let_go()
        if not one.proofs or not left:
            break
        print(f"once more, {left} left, for the machine was away:", *one.proofs)
        longest = max(one.excuse, key=lambda hole: hole.s, default=None)
        retries.note(str(longest or one.proofs[0]))
    raise AssertionError(one.account())
