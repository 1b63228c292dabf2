"""Servers of this machine on one page, for reading alone.

They are found by their runtime directories, and asked for their status as any program of this user
may; nothing else is ever asked of them. Whoever may watch one robot may see of the others what
stands here.
"""

from __future__ import annotations

import asyncio
import http.client
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Literal

import msgspec
from fastapi import Depends
from fastapi.routing import APIRoute
from starlette.responses import Response

from server.common.access import PhoneClientError, run_of
from server.common.clock import now
from server.common.runtime import Launch, is_running, launch_of, servers_here
from server.security.least_role import viewer

HERE, ANSWER_S = "127.0.0.1", 1.0
"""One that takes longer to answer is silent: its robot is nothing that anybody here knows of."""
SHOWN_S = 0.5
"""So old an answer may be, however many pages ask."""
MOST_BYTES = 1_000_000
"""Of a status: more than any is."""

State = Literal["live", "starting", "silent", "gone"]
"""silent: it runs, but does not answer; gone: it ended without a word."""


class FleetPerson(msgspec.Struct, frozen=True):
    """As much as is shown of a person: see `Person`."""

    name: str
    leads: bool


class FleetStatus(msgspec.Struct, frozen=True):
    """As much as is shown of a status: see `Status`."""

    mode: str
    reason: str
    robot: str
    operator: str
    latency_ms: dict[str, float]
    people: list[FleetPerson]
    battery_v: float | None = None
    """None: it is not told."""

    @property
    def leader(self) -> str:
        """Name of who leads, and by which device; "" of nobody."""
        names = [one.name for one in self.people if one.leads]
        return ", ".join(filter(None, (*names, self.operator))) if self.operator else ""


class FleetServer(msgspec.Struct, frozen=True):
    """One server of this machine."""

    name: str
    """"" without one."""
    robot: str
    state: State
    https_port: int
    http_port: int
    mode: str = ""
    """"" unless it is live."""
    reason: str = ""
    leader: str = ""
    latency_ms: float | None = None
    """From capture to thrusts; None unless a phone leads."""
    battery_v: float | None = None


class FleetAnswer(msgspec.Struct, frozen=True):
    """What `/api/fleet` answers."""

    servers: list[FleetServer]
    """By name; the one without is the first."""


_status = msgspec.json.Decoder(FleetStatus)


class Fleet:
    """Asks all servers of this machine, at most twice a second."""

    def __init__(self, clock: Callable[[], float] = now) -> None:
        """Begin without an answer."""
        self._clock = clock
        self._asking = asyncio.Lock()
        self._t, self._answer = -float("inf"), b""

    def routes(self) -> list[APIRoute]:
        """The one request."""
        watches = [Depends(viewer)]
        return [APIRoute("/api/fleet", self._reply, dependencies=watches)]

    async def _reply(self) -> Response:
        """All servers of this user here."""
        async with self._asking:
            if self._clock() - self._t >= SHOWN_S:
                answer = FleetAnswer(await seen())
                self._t, self._answer = self._clock(), msgspec.json.encode(answer)
        return Response(self._answer, media_type="application/json")


async def seen() -> list[FleetServer]:
    """All servers of this user, those that ended without a word among them."""
    asked: Sequence[FleetServer | None] = await asyncio.gather(
        *(asyncio.to_thread(_seen, name, place) for name, place in servers_here().items())
    )
    return [one for one in asked if one is not None]


def _seen(name: str, directory: Path) -> FleetServer | None:
    """The server of that runtime directory; None if there is none, or it has ended as told to."""
    launch, runs = launch_of(directory), is_running(directory)
    if launch is None:
        return None
    state: State = "starting" if runs else "gone"
    with suppress(PhoneClientError, LookupError):
        run = run_of(directory)
        if runs:
            return _answered(name, launch, str(run["operator_token"]))
    return _unheard(name, launch, state)


def _answered(name: str, launch: Launch, key: str) -> FleetServer:
    try:
        status = _asked(launch.http_port, key)
    except (OSError, http.client.HTTPException, msgspec.MsgspecError):
        return _unheard(name, launch, "silent")
    latencies = status.latency_ms.values()
    return FleetServer(
        name,
        status.robot,
        "live",
        launch.https_port,
        launch.http_port,
        status.mode,
        status.reason,
        status.leader,
        round(sum(latencies), 1) if latencies else None,
        status.battery_v,
    )


def _unheard(name: str, launch: Launch, state: State) -> FleetServer:
    return FleetServer(name, Path(launch.robot).stem, state, launch.https_port, launch.http_port)


def _asked(port: int, key: str) -> FleetStatus:
    with closing(http.client.HTTPConnection(HERE, port, timeout=ANSWER_S)) as line:
        line.request("GET", "/api/status", headers={"Authorization": f"Bearer {key}"})
        return _status.decode(line.getresponse().read(MOST_BYTES))
