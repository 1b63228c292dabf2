"""Who may come in: links, cookies, keys, Host, Origin. Pure ASGI: it guards websockets too."""

from __future__ import annotations

import base64
import hmac
import logging
import re
import secrets
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec
from msgspec.structs import replace
from starlette.requests import cookie_parser
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.admission import Admission, network_of, peer_of
from server.audit import Audit
from server.clock import now
from server.pairings import Book, Confirm, Member, Pairings, of_this_machine
from server.roles import Role, is_enough, least_of
from server.runtime import write_private
from server.sockets import Sockets

log = logging.getLogger("lightleash")

COOKIE = "lightleash"
PAIR_TRIES, PAIR_WINDOW_S = 10, 60.0
"""So many wrong links of one address in that time."""
MAX_ADDRESSES = 1_000
PORT = re.compile(r":\d{1,5}$")
"""The port at the end of a Host header; an IPv6 address is in brackets."""

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "media-src 'self' blob:; connect-src 'self'; worker-src 'self'; frame-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
SENSORS = "camera=(self), accelerometer=(self), gyroscope=(self), magnetometer=(self)"
HEADERS = {
    "permissions-policy": SENSORS,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}
Refusal = tuple[int, str, str]
"""Status, field, what is allowed."""


class Doors:
    """Keys of this run, and the members that its links have let in.

    Keys follow from the secret of the run and members are kept in a private file, so that a server
    process that was started anew within a run still knows both. Another run has another secret and
    begins without members: yesterday's link opens nothing.
    """

    def __init__(
        self,
        secret: bytes | None = None,
        confirm: Confirm = "supervisor",
        store: Path | None = None,
        audit: Audit | None = None,
        clock: Callable[[], float] = now,
    ) -> None:
        """By default with a secret of its own, and members that are forgotten with it."""
        self._secret = secret or secrets.token_bytes(32)
        self.operator_token = self._sign("token operator")
        self.supervisor_token = self._sign("token supervisor")
        self._store, self.clock = store, clock
        self.pairings = Pairings(confirm, book=_book_in(store))
        self.audit = audit or Audit()
        self.sockets = Sockets()
        self.on_gone: Callable[[str], None] = lambda address: None
        """Called when nobody of an address is in any more."""
        self._tries: dict[str, list[float]] = {}

    def save(self) -> bool:
        """Keep who is here: as long as the run, for nobody else to read. False if it can't be kept.

        A disk that is full keeps nobody in, and ends no server.
        """
        try:
            if self._store is not None:
                write_private(self._store, msgspec.json.encode(self.pairings.book).decode())
        except OSError as error:
            log.error("who is paired can't be written down: %s", error)
            return False
        return True

    def _sign(self, text: str) -> str:
        """128 bits that nobody else can make."""
        digest = hmac.digest(self._secret, text.encode(), "sha256")[:16]
        return base64.urlsafe_b64encode(digest).rstrip(b"=").decode()

    def role_of_token(self, token: str) -> Role | None:
        """Whose key of the run it is, in constant time."""
        given = token.encode("utf-8", "replace")
        if secrets.compare_digest(given, self.supervisor_token.encode()):
            return "supervisor"
        if secrets.compare_digest(given, self.operator_token.encode()):
            return "operator"
        return None

    def may_try(self, address: str) -> bool:
        """Whether `address` may try another link."""
        return len(self._recent(address)) < PAIR_TRIES

    def tried(self, address: str) -> None:
        """`address` has tried a link that opens nothing."""
        tries = [*self._recent(address), self.clock()]
        self._tries.pop(network_of(address), None)
        self._tries[network_of(address)] = tries
        if len(self._tries) > MAX_ADDRESSES:
            del self._tries[next(iter(self._tries))]

    def _recent(self, address: str) -> list[float]:
        since = self.clock() - PAIR_WINDOW_S
        return [t for t in self._tries.get(network_of(address), ()) if t > since]

    def who(self, headers: dict[str, str], secure: bool, address: str) -> Member | None:
        """By the key of a program or the cookie of a page; in whatever state.

        Over TLS only the cookie counts that a browser takes from nobody but us over TLS: another
        one may have been planted by whoever sits between.
        """
        scheme, _, token = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            role = self.role_of_token(token.strip())
            return of_this_machine(role, address) if role is not None else None
        value = cookie_parser(headers.get("cookie", "")).get(cookie_name(secure), "")
        return self.pairings.of_cookie(value, self.clock()) if value else None


def cookie_name(secure: bool) -> str:
    """Of the session's cookie, over TLS or on this machine."""
    return f"__Host-{COOKIE}" if secure else COOKIE


def _book_in(store: Path | None) -> Book | None:
    """What a server process before this one has left."""
    if store is None or not store.exists():
        return None
    try:
        return msgspec.json.decode(store.read_bytes(), type=Book)
    except (OSError, msgspec.MsgspecError) as error:
        log.warning("%s can't be read, everybody has to pair again: %s", store, error)
        return None


class Guard:
    """Refuses foreign hosts and origins, and those without the role; adds the security headers."""

    def __init__(
        self,
        app: ASGIApp,
        doors: Doors,
        hosts: Iterable[str],
        admission: Admission | None = None,
    ) -> None:
        """`hosts` are the names and addresses this server answers to.

        `admission` is told whose address has shown a role, and limits what others ask.
        """
        self._app, self._doors = app, doors
        self._admission = Admission() if admission is None else admission
        doors.on_gone = self._admission.forget
        self._hosts = {f"[{host}]" if ":" in host else host.lower() for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let in or turn away."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        peer = peer_of(scope)
        member = self._doors.who(headers, scope["scheme"] in ("https", "wss"), peer.host)
        is_in = member is not None and member.state == "in"
        if not self._admission.may_ask(peer, is_in, now()):
            await _refuse((429, "requests", "fewer"), scope, receive, send)
            return
        refusal = self._refusal(scope, headers, member)
        if refusal is not None:
            self._note(refusal, member, peer.host, scope["path"])
            await _refuse(refusal, scope, receive, send)
            return
        scope["member"] = replace(member, address=peer.host) if member is not None else None
        if scope["type"] == "websocket" and member is not None:
            await self._doors.sockets.run(self._app, member.id, scope, receive, send)
            return
        await self._app(scope, receive, _with_headers(scope, headers.get("host", ""), send))

    def _note(self, refusal: Refusal, member: Member | None, address: str, path: str) -> None:
        name, role = (member.name, member.role) if member is not None else ("", "")
        status, field, allowed = refusal
        why = f"{path}: {status} {field}: {allowed}"
        self._doors.audit.note("refusal", name, role, address, why[:200])

    def _refusal(
        self, scope: Scope, headers: dict[str, str], member: Member | None
    ) -> Refusal | None:
        """Why not, or None for welcome."""
        host = headers.get("host", "")
        if PORT.sub("", host).lower() not in self._hosts:
            return 421, "Host", "an address of this server"
        bearer = headers.get("authorization", "").lower().startswith("bearer ")
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if changes and not bearer and not self._is_own(scope, headers, host):
            return 403, "Origin", "this server's own pages"
        least = least_of(scope["path"], is_read=not changes)
        if least == "anyone":
            return None
        if member is None:
            return 401, "role", "pair first: open the link or scan the QR code"
        if least == "known":
            return None
        if member.state == "waiting":
            return 403, "pairing", "once a supervisor has confirmed it"
        if member.state != "in":
            return 401, "role", f"pair anew: this pairing has ended. {member.why}".strip()
        return None if is_enough(member.role, least) else (403, "role", least)

    def _is_own(self, scope: Scope, headers: dict[str, str], host: str) -> bool:
        """A page of another site can neither know our origin nor set our header."""
        scheme = {"ws": "http", "wss": "https"}.get(scope["scheme"], scope["scheme"])
        if headers.get("origin") != f"{scheme}://{host}":
            return False
        return scope["type"] == "websocket" or "x-lightleash" in headers


async def _refuse(refusal: Refusal, scope: Scope, receive: Receive, send: Send) -> None:
    status, field, allowed = refusal
    body = {"code": "role" if status == 401 else "refused", "field": field, "allowed": allowed}
    response = JSONResponse(body, status)
    if scope["type"] == "http" or "websocket.http.response" in scope.get("extensions", {}):
        await response(scope, receive, send)
    else:
        await send({"type": "websocket.close", "code": 1008})


def _with_headers(scope: Scope, host: str, send: Send) -> Send:
    if scope["type"] == "websocket":
        return send
    # older Safari does not count websockets of the same origin as 'self'
    scheme = "wss" if scope["scheme"] == "https" else "ws"
    policy = PAGE_POLICY.replace("connect-src 'self'", f"connect-src 'self' {scheme}://{host}")
    headers = {"content-security-policy": policy, **HEADERS}

    async def extended(message: Message) -> None:
        if message["type"] == "http.response.start":
            present = {name.lower() for name, _ in message["headers"]}
            extra = [
                (k.encode(), v.encode()) for k, v in headers.items() if k.encode() not in present
            ]
            message = {**message, "headers": [*message["headers"], *extra]}
        await send(message)

    return extended
