"""What is said over HTTPS before a WebRTC connection: ask, offer, answer."""

from __future__ import annotations

import msgspec


class Ask(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Body of `POST /api/rtc`: an offer for the phone of this session, please."""

    session: str


class Offer(msgspec.Struct, frozen=True):
    """Its answer."""

    id: str
    sdp: str
    ice_servers: list[dict[str, str]]
    """As `RTCPeerConnection` takes them; none where phone and server meet directly."""


class Answer(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Body of `POST /api/rtc/answer`: the page's session description."""

    id: str
    """Of the offer."""
    sdp: str


class Connecting(msgspec.Struct, frozen=True):
    """Its answer: packets may come."""

    connecting: bool = True
