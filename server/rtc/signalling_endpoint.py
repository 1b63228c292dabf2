"""Signalling by HTTPS POST, behind the same guard as all: the page asks, we offer, it answers."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

from fastapi import Depends
from starlette.requests import Request
from starlette.routing import BaseRoute

from server.common.clock import now, unix_ms
from server.common.settings import RtcSettings
from server.protocol.session import TokenBucket
from server.protocol.signalling import Answer, Ask, Connecting, Offer
from server.protocol.wire import WireError
from server.rtc.answer import MAX_BYTES
from server.rtc.link import RtcLink
from server.security.least_role import RefusedRequest, operator
from server.web.session_manager import SessionManager
from server.web.typed_routes import ApiRoute, Asked, Reply

log = logging.getLogger("lightleash")

OFFERS_HZ, OFFERS_AT_ONCE = 0.5, 10
MAX_ANSWER_BODY = MAX_BYTES + 2_048
"""JSON adds a little to the session description."""
OFF = "WebRTC is switched off (rtc.enabled): use the websockets"
NOT_LEADING = "the session of the phone that leads"


class AnswerRoute(ApiRoute):
    """Takes a session description."""

    longest = MAX_ANSWER_BODY


def address_of(request: Request) -> str:
    """Where it came from."""
    return request.client.host if request.client is not None else ""


class SignallingEndpoint:
    """Signalling of at most one connection, that of the phone that leads."""

    def __init__(self, manager: SessionManager, settings: RtcSettings, bitrate_bps: int) -> None:
        """Begin without a connection."""
        self._manager, self._settings, self._bitrate_bps = manager, settings, bitrate_bps
        self._offers = TokenBucket(OFFERS_HZ, OFFERS_AT_ONCE)
        self._link: RtcLink | None = None
        self._closing: set[asyncio.Task[None]] = set()

    def routes(self) -> Sequence[BaseRoute]:
        """Both requests."""
        post, leads = ["POST"], [Depends(operator)]
        return [
            ApiRoute("/api/rtc", self._ask, methods=post, dependencies=leads),
            AnswerRoute(
                "/api/rtc/answer", self._answer, methods=post, status_code=202, dependencies=leads
            ),
        ]

    async def close(self) -> None:
        """Hang up."""
        if self._link is not None:
            self._gone(self._link)
        await asyncio.gather(*self._closing, return_exceptions=True)

    async def _ask(self, ask: Asked[Ask]) -> Reply[Offer]:
        """Offer a connection to the phone that leads."""
        phone = self._manager.phone
        if not self._settings.enabled:
            raise RefusedRequest(404, "rtc", OFF)
        if phone is None or phone.id != ask.session:
            raise RefusedRequest(403, "session", NOT_LEADING)
        if not self._offers.take(now()):
            raise RefusedRequest(429, "rtc", f"{60.0 * OFFERS_HZ:g} offers a minute")
        link = RtcLink(self._manager, phone, self._settings, self._bitrate_bps, self._gone)
        former, self._link = self._link, link
        if former is not None:
            self._gone(former)
        sdp = await link.peer.offer()
        if (
            link.is_closing or self._manager.phone is not phone
        ):  # meanwhile it was shut out, or asked anew
            self._gone(link)
            raise RefusedRequest(403, "session", NOT_LEADING)
        return Offer(link.id, sdp, self._settings.ice_servers(1e-3 * unix_ms()))

    async def _answer(self, request: Request, answer: Asked[Answer]) -> Reply[Connecting]:
        """Take the page's answer to the newest offer; a second one ends nothing."""
        link = self._link
        if link is None or link.id != answer.id:
            raise RefusedRequest(404, "id", "of the newest offer")
        is_first = not link.peer.is_answered
        try:
            await link.peer.answer(answer.sdp, address_of(request))
        except WireError as error:
            log.warning("an answer is refused: %s", error)
            if is_first:  # else it may be flown by
                self._gone(link)
            raise
        if link.is_closing or self._manager.join_fast(link.session, link) is None:
            self._gone(link)
            raise RefusedRequest(403, "session", NOT_LEADING)
        return Connecting()

    def _gone(self, link: RtcLink) -> None:
        """A connection has ended, or shall."""
        if self._link is link:
            self._link = None
        self._manager.paths.leave(link)
        if not link.is_closing:
            link.is_closing = True
            task = asyncio.get_running_loop().create_task(link.hang_up())
            self._closing.add(task)
            task.add_done_callback(self._closing.discard)
