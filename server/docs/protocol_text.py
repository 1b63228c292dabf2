"""The words of `PROTOCOL.md` around its generated tables; every figure is the code's own."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from starlette.routing import Route, WebSocketRoute

from server.phone import ingest
from server.protocol import session, wire, wire_records
from server.protocol.wire import Kind
from server.rtc import answer, link
from server.rtc.receiving import metadata_trailer
from server.rtc.signalling_endpoint import OFFERS_HZ, SignallingEndpoint
from server.security.least_role import roles_of
from server.security.pairings import CODE_LETTERS, IDLE_S, KEY_BYTES, LINK_S, WAIT_S
from server.security.security import COOKIE, PAIR_TRIES, PAIR_WINDOW_S
from server.view.fleet import Fleet
from server.view.viser_proxy import routes as view_routes
from server.virtual_phone.phone_client import MAX_IN_FLIGHT
from server.web.app import Api
from server.web.lease import GIVEN_S, LEASE_S
from server.web.people_api import PeopleApi
from server.web.session_manager import TICK_S
from server.web.typed_routes import MAX_BODY
from server.web.websocket import HELLO_S, PING_S

Layout = tuple[type[Any], struct.Struct | None, tuple[tuple[str, int], ...]]

RECORDS: dict[Kind, Layout] = {
    Kind.MOTION: (
        wire_records.Motion,
        wire.MOTION,
        (
            ("rotation_rate", 3),
            ("acceleration", 3),
            ("orientation_wxyz", 4),
            ("screen_angle_deg", 1),
            ("", 1),
        ),
    ),
    Kind.FRAME: (
        wire_records.Picture,
        wire.FRAME,
        (("codec", 1), ("shrunk", 1), ("width", 1), ("height", 1), ("screen_angle_deg", 1)),
    ),
    Kind.TOUCH: (
        wire_records.Touch,
        wire.TOUCH,
        (("held", 1), ("visible", 1), ("", 1), ("press", 1), ("nonce", 1)),
    ),
    Kind.PONG: (wire_records.Pong, wire.PONG, (("nonce", 1), ("server_time_us", 1))),
    Kind.STAMP: (wire_records.Stamp, wire.STAMP, (("rtp_timestamp", 1),)),
    Kind.PING: (wire_records.Ping, wire.PING, (("nonce", 1),)),
    Kind.CREDIT: (wire_records.Credit, wire.CREDIT, (("sequence", 1),)),
    Kind.PICTURE: (wire_records.Thumbnail, None, ()),
}
"""Fields of each payload in the order of its bytes; "" is padding."""

CODES = {
    "type": "not a record or message at all, or of a kind nobody knows",
    "size": "too short or too long",
    "version": "another version of the protocol",
    "value": "out of its range, not finite, or a field nobody knows",
    "age": "asked for too long ago: the link was away, and somebody else may be flying now",
    "order": "before `hello`, `hello` twice, or not now",
    "rate": "too much a second",
    "role": "not as this role, or somebody else has the place",
    "calibration": "no calibration of this camera at this picture size",
}
"""Every code of `Refused` and what it means."""

REQUESTS = {
    "POST /api/pair": 'body `{"token": "…", "name": "…"}`; answers as `whoami`, sets the cookie; '
    "or 409 with `held`, `offered`, `waits`: this browser may do more already, and gives that up "
    'with `"replace": true`',
    "GET /api/whoami": "role, state (waiting, in, denied, revoked, expired), name, code, why",
    "POST /api/people/confirm": 'body `{"id": "…", "code": "…"}`: let in who waits with that code',
    "POST /api/people/deny": 'body `{"id": "…"}`: turn away who waits',
    "POST /api/people/revoke": 'body `{"id": "…"}`: end a pairing, and its sockets at once',
    "POST /api/people/keep": 'body `{"id": "…"}`: end that; who gave it, who was to have it, '
    "or a supervisor",
    "POST /api/people/lead": 'body `{"id": "…"}`: keep the lead for that one; also who leads may',
    "POST /api/stop": "STOP, when the socket is gone or stuck; body: nothing, or the `command`; "
    "answers with the robot's `mode` as it was then",
    "POST /api/virtual-phone": "start the virtual phone",
    "DELETE /api/virtual-phone": "stop it",
    "POST /api/recording": "start recording",
    "DELETE /api/recording": "stop; answers with the path of the file",
    "POST /api/invite": 'body `{"role": "operator"}` or viewer: a link that opens once, as QR code',
    "GET /api/status": "the last `Status`",
    "GET /api/link": "how it will be to fly with the operator's link: `?seconds=` of the last 60",
    "POST /api/task": 'body `{"text": "…"}`: what the next presses are for, as recordings keep it',
    "POST /api/episode": 'body `{"press": N, "keep": false}`: nobody should learn from the newest '
    "press of the recording that runs; with `true` somebody should",
    "GET /api/check": "what the leading phone shows of itself, line by line, for the page `/check`:"
    " `?seconds=` of the last 300 for what heat does, and of the last 60 for all else",
    "GET /ca.crt": "the authority to install on phones",
    "GET /healthz": "200, or 503 with `reasons`: control is silent, nothing can be recorded",
    "GET /metrics": "Prometheus",
    "GET /api/openapi.json": "these requests and their answers field by field, for programs",
    "POST /api/rtc": 'WebRTC, body `{"session": "…"}`; answers `{"id", "sdp", "ice_servers"}`',
    "POST /api/rtc/answer": 'body `{"id": "…", "sdp": "…"}`: the page\'s answer to that offer',
    "GET /api/fleet": "the servers of this machine, for their page `/fleet`: name, robot, ports, "
    "state (live, starting, silent, gone) and of a live one mode, reason, leader, latency, battery",
    "GET /view": "the 3D view's page",
    "GET /view/": "the same",
    "socket /view": "the 3D view's socket (viser's protocol); only a viewpoint may go up",
    "socket /view/": "the same",
}
"""What each address is for; the three pages' sockets are told of above."""


def requests() -> str:
    """The table of requests, in step with the routes.

    Raises:
        KeyError: a route has no words.
    """
    lines = ["| request | least role | |", "|---|---|---|"]
    api, people = Api.__new__(Api), PeopleApi.__new__(PeopleApi)  # only asked for their routes
    signalling = SignallingEndpoint.__new__(SignallingEndpoint)
    others = (*people.routes(), *signalling.routes(), *view_routes(Path("nowhere")))
    others = (*others, *Fleet.__new__(Fleet).routes())
    roles = roles_of((*api.routes(), *others))
    for route in (*api.routes(), *others):
        assert isinstance(route, (Route, WebSocketRoute))
        methods = ["socket"] if isinstance(route, WebSocketRoute) else sorted(route.methods or ())
        for method in methods:
            if method != "HEAD":
                request = f"{method} {route.path}"
                least = roles.of(route.path, is_read=method == "GET")
                lines.append(f"| `{request}` | {least} | {REQUESTS[request]} |")
    return "\n".join(lines)


def page(records: str, messages: str, links: str) -> str:
    """`PROTOCOL.md`."""
    codes = "\n".join(f"| `{code}` | {words} |" for code, words in CODES.items())
    return f"""# Protocol

Version {wire.VERSION}. Generated from `server/protocol/wire.py`, `server/protocol/wire_records.py`,
`server/protocol/messages.py`, `hardware/link/` and the server's routes by
`python -m server.docs.generate`: edit
those, not this.

## Sockets

| websocket | least role | page → server | server → page |
|---|---|---|---|
| `/ws/phone` | operator | `hello`, `command`, `lead`, `path`, `calibrate`, `log`; MOTION, TOUCH, \
PONG | `welcome`, `status`, `refused`, `calibration`, `path`, `command` (`key_frame`); PING |
| `/ws/video` | operator | `hello`, `log`; FRAME | `welcome`, `refused`; CREDIT |
| `/ws/supervisor` | viewer | `hello`, `command`, `tune`, `lead`, `path`, `log` | `welcome`, \
`status`, `refused`; PICTURE |

A binary websocket message is one *record*, a text message is one JSON *message*. Compression is
off. Phones come by HTTPS; the HTTP listener is for this machine alone.

1. The page sends `hello` within {HELLO_S:g} s; nothing else is taken before it.
2. The server answers `welcome`, or `refused` with `fatal` and closes. One phone leads at a time:
   another one is refused (`role`) until the first has gone or was silent for {LEASE_S:g} s. A
   phone that has lost its place is refused (`role`, `fatal`).
3. An operator opens `/ws/video` with the `session` of its `welcome`. Pictures have a socket of
   their own so that a large one never delays a sign of life.
4. `status` comes every {1e3 * TICK_S:g} ms. A page that does not read loses the oldest, never the
   newest.

## Authentication

A link carries a key of {8 * KEY_BYTES} random bits behind `#k=`; it opens once, within
{LINK_S / 60:g} minutes. The page takes it out of the address and sends it to `POST /api/pair` with
a name, which answers with a cookie: `{COOKIE}` on HTTP, `__Host-{COOKIE}` (Secure) on HTTPS;
HttpOnly, SameSite=Strict; each counts on its own kind of connection alone. An operator then waits
(`state: waiting`) with a `code` of {CODE_LETTERS} letters until a supervisor, who sees the same
letters, confirms; after {WAIT_S / 60:g} minutes it is turned away. With `pairing.confirm = "self"`
the link is enough. A pairing lasts as long as the run, or until it is revoked or unused for
{IDLE_S / 3600:g} h; revoked, its sockets are closed (4403). Wrong links: {PAIR_TRIES} in
{PAIR_WINDOW_S:g} s for each address (IPv6: each /64), then 429. Programs of the user who runs the
server send `Authorization: Bearer <key>` instead, with a key of the run file.

Roles are viewer < operator < supervisor; each may do what those before it may. A viewer sees all
and may STOP. On `/ws/supervisor` viewers and operators may say STOP and nothing else. Who leads, or
a supervisor, may give the lead to another operator; it is kept for that one for {GIVEN_S:g} s,
during which nobody leads, and pages ask the person before they say `hello` as the new leader. The
robot is disarmed whenever the lead changes; in flight only a supervisor may change it, and the
robot comes down first.

`Host` must be an address of this server (421). Websockets and every request but GET and HEAD must
come from the server's own pages (403): `Origin` is the server's, and requests carry the header
`X-Lightleash`. A bearer token stands for both. Without a role: 401, without the right one: 403.

## Requests

{requests()}

Bodies up to {MAX_BODY} bytes (an answer's session description: {answer.MAX_BYTES}). Pages (`/`,
`/supervisor`, `/board`, `/screen`, `/fleet`, `/check`) and their files need no role. Refusals are
JSON, as below: `code`, `field`, `allowed`.

## Records

Little-endian: a header of {wire.HEADER.size} bytes, then the payload; at most
{wire.MAX_RECORD_BYTES} bytes together. Kinds below 128 come from the page.

{records}

## Messages

One JSON object each, at most {wire.MAX_MESSAGE_BYTES} bytes from a page. `type` says which.
Unknown fields from a page are refused; a page ignores those it does not know.

{messages}

## Errors

What can't be taken is answered by `refused` with code, field and what is allowed, to its sender
alone; nothing else of the sender is lost. After {session.MAX_FAULTS} of them, of which one is
forgiven every {1.0 / session.FAULTS_HZ:g} s, or when `fatal`, the server closes the connection.

| code | |
|---|---|
{codes}

A connection may send {session.RECORDS_HZ:g} records, {1e-6 * session.BYTES_HZ:g} MB and
{session.MESSAGES_HZ:g} messages a second; `stop` is always taken. A websocket message beyond the
size of a record closes its connection (1009).

## Flow control

At most {MAX_IN_FLIGHT} FRAMEs may be under way. The server answers each it has taken, refused or
replaced by a newer one with the CREDIT of the newest number: that one and all before it are done.
Frames without credit are dropped on the phone, newest wins. `command` `key_frame` from the server
asks for a FRAME that can be decoded alone.

## WebRTC

Faster than the websockets, and beside `/ws/phone`, which stays open for all that must not be lost.
The server offers: `POST /api/rtc` with the `session` of the `welcome`, at most
{60.0 * OFFERS_HZ:g} a minute; a new offer ends the connection before. The page's answer goes to
`POST /api/rtc/answer` within {link.CONNECT_S:g} s: `video` sendonly (H264 or VP8) and the data
channel, at most {answer.MAX_CANDIDATES} candidates; anything else is refused. Without a relay
(`rtc.turn_url`) both ends have their own addresses only, and nobody else is asked for them.

The data channel (unordered, never sent again) carries MOTION, TOUCH, PONG and STAMP to the server
and PING to the page. What can't leave at once is dropped. PINGs and TOUCHes go by both ways at
once, so that no sign of life is missed when one of them ends: the page answers the first PING of a
number, with the newest TOUCH too if that is no older than 100 ms, by the same way. TOUCHes that
were overtaken or heard are ignored. MOTION goes by the data channel while the page has heard the
server there within 200 ms, else by the websocket.

Each encoded picture has its record behind it: {metadata_trailer.TRAILER_BYTES} bytes, each with its
highest bit set so that no start code appears. In groups of {metadata_trailer.GROUP}, each followed
by a byte whose bits 0 to {metadata_trailer.GROUP - 1} are the group's highest bits, little-endian:
sequence u32, time i64 [µs of the page's clock], flags u8 (bits 0 and 1: screen angle / 90°, bit 2:
there is an orientation, bits 3 and 4: `shrunk` of FRAME), orientation w, x, y, z as 4 × i16 (32767
is 1), CRC-16 (polynomial 0x1021, from 0) of these {metadata_trailer.FIELDS.size} bytes; then the
bytes {metadata_trailer.MARK.hex(" ")}. Where a picture can't be appended to, STAMP says when it was
taken; without either it is dated by its arrival, up to {1e3 * ingest.ARRIVAL_S:g} ms wrong. There
are no CREDITs: a key frame is asked for by RTCP. Of pictures that come by both ways those of one
count; the other one takes over with a key picture that was taken after all of them. What else comes
by `/ws/video` is given back unseen.

## Clocks and signs of life

A PING comes {1.0 / PING_S:g} times a second by every way that is open, with a fresh random nonce.
None waits behind another: of those that could not leave the newest goes. The page answers PONG at
once (PINGs that come together, as after a gap, are answered by the first and the newest), stamped
with its own clock; of the last answers the one with the shortest round trip gives the offset
between the clocks (NTP's rule). MOTION and FRAME are dated by that; before it is known they are
dropped. Dated after their arrival they count as taken then, by more than
{1e3 * ingest.FUTURE_S:g} ms they are refused.

TOUCH is made by the page's main thread and returns the newest nonce. It counts as made when that
PING was sent; or later, up to {ingest.UNHEARD_S:g} s, as its own stamp says by the worst that the
answers' round trips leave possible. So old bytes, a hung page or a proxy that answers pings can't
keep the robot flying, and who is heard well is not taken for silent while our PINGs are late. Of
the last {ingest.REMEMBERED_NONCES} nonces each is taken; nonce 0 says that none has come yet. A
PONG is taken once.

## The robot's link

By UDP, each end with the robot's key, which `lightleash robot key` makes: between control and a
robot, never a page. With `[link] kind` another link is spoken instead.

{links}

## Versions

`hello`, `welcome` and every record carry the version. There is no negotiation: the server serves
the pages that fit it, and a page of another version is refused (`version`) and asks its user to
reload. Once there is a release, any change to bytes, fields or their meaning raises it.
"""
