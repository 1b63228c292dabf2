"""Signalling by HTTPS POST, behind the same guard as all: the page asks, we offer, it answers."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

import msgspec
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from server.common.clock import now
from server.common.settings import RtcSettings
from server.protocol.session import TokenBucket
from server.protocol.signalling import Answer, Ask, Offer
from server.protocol.wire import WireError
from server.rtc.answer import MAX_BYTES
from server.rtc.link import RtcLink
from server.web.replies import body_of, refusal
from server.web.session_manager import SessionManager

log = logging.getLogger("lightleash")

OFFERS_HZ, OFFERS_AT_ONCE = 0.5, 10
MAX_ANSWER_BODY = MAX_BYTES + 2_048
"""JSON adds a little to the session description."""
OFF = "WebRTC is switched off (rtc.enabled): use the websockets"


_ask, _answer = msgspec.json.Decoder(Ask), msgspec.json.Decoder(Answer)


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
        return [
            Route("/api/rtc", self._ask, methods=["POST"]),
            Route("/api/rtc/answer", self._answer, methods=["POST"]),
        ]

    async def close(self) -> None:
        """Hang up."""
        if self._link is not None:
            self._gone(self._link)
        await asyncio.gather(*self._closing, return_exceptions=True)

    async def _ask(self, request: Request) -> Response:
        try:
            ask = _ask.decode(await body_of(request))
        except msgspec.DecodeError:
            return refusal(400, "session", 'JSON: {"session": "…"}')
        phone = self._manager.phone
        if not self._settings.enabled:
            return refusal(404, "rtc", OFF)
        if phone is None or phone.id != ask.session:
            return refusal(403, "session", "the session of the phone that leads")
        if not self._offers.take(now()):
            return refusal(429, "rtc", f"{60.0 * OFFERS_HZ:g} offers a minute")
        link = RtcLink(self._manager, phone, self._settings, self._bitrate_bps, self._gone)
        former, self._link = self._link, link
        if former is not None:
            self._gone(former)
        sdp = await link.peer.offer()
        if (
            link.is_closing or self._manager.phone is not phone
        ):  # meanwhile it was shut out, or asked anew
            self._gone(link)
            return refusal(403, "session", "the session of the phone that leads")
        offer = Offer(link.id, sdp, self._settings.ice_servers())
        return Response(msgspec.json.encode(offer), media_type="application/json")

    async def _answer(self, request: Request) -> Response:
        try:
            answer = _answer.decode(await body_of(request, MAX_ANSWER_BODY))
        except msgspec.DecodeError:
            return refusal(400, "sdp", f'JSON up to {MAX_BYTES} bytes: {{"id": "…", "sdp": "…"}}')
        link = self._link
        if link is None or link.id != answer.id:
            return refusal(404, "id", "of the newest offer")
        try:
            await link.peer.answer(answer.sdp, address_of(request))
        except WireError as error:
            log.warning("an answer is refused: %s", error)
            self._gone(link)
            return refusal(400, error.field, error.allowed)
        if link.is_closing or self._manager.join_fast(link.session, link) is None:
            self._gone(link)
            return refusal(403, "session", "the session of the phone that leads")
        return JSONResponse({"connecting": True}, 202)

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
