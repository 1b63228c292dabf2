"""Who may come in: tokens, cookies, Host, Origin. Pure ASGI: it guards websockets too."""

from __future__ import annotations

import base64
import hmac
import re
import secrets
from collections.abc import Iterable
from typing import Literal, cast, get_args

from starlette.requests import cookie_parser
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.admission import Admission, peer_of
from server.clock import now

Role = Literal["operator", "supervisor"]
COOKIE = "lightleash"
PUBLIC_FILES = (".js", ".css", ".svg")
PUBLIC_PATHS = {"/", "/supervisor", "/board", "/api/pair", "/healthz", "/ca.crt"}
OPERATOR_PATHS = {
    *("/api/whoami", "/api/stop", "/api/link", "/api/rtc", "/api/rtc/answer"),
    *("/ws/phone", "/ws/video"),
}
"""What an operator may reach; everything else is the supervisor's."""
PAIR_TRIES, PAIR_WINDOW_S = 10, 60.0
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


class Doors:
    """Tokens of this run, and the sessions they are exchanged for.

    Both follow from one secret, so that a server process that was started anew within a run still
    knows the pages, and nothing has to be kept. Another run has another secret: yesterday's link
    opens nothing.
    """

    def __init__(self, secret: bytes | None = None) -> None:
        """By default with a secret of its own."""
        self._secret = secret or secrets.token_bytes(32)
        self.operator_token = self._sign("token operator")
        self.supervisor_token = self._sign("token supervisor")
        self._tries: dict[str, list[float]] = {}

    def _sign(self, text: str) -> str:
        """128 bits that nobody else can make."""
        digest = hmac.digest(self._secret, text.encode(), "sha256")[:16]
        return base64.urlsafe_b64encode(digest).rstrip(b"=").decode()

    def role_of_token(self, token: str) -> Role | None:
        """Whose token it is, in constant time."""
        given = token.encode("utf-8", "replace")
        if secrets.compare_digest(given, self.supervisor_token.encode()):
            return "supervisor"
        if secrets.compare_digest(given, self.operator_token.encode()):
            return "operator"
        return None

    def pair(self, token: str) -> tuple[Role, str] | None:
        """Exchange a token for a session: (role, cookie's value)."""
        role = self.role_of_token(token)
        if role is None:
            return None
        session = f"{role}.{secrets.token_urlsafe(12)}"
        return role, f"{session}.{self._sign(session)}"

    def _role_of_session(self, value: str) -> Role | None:
        """Role in a cookie that we have made."""
        session, _, signature = value.encode("ascii", "replace").decode().rpartition(".")
        role = session.partition(".")[0]
        if role not in get_args(Role) or not hmac.compare_digest(signature, self._sign(session)):
            return None
        return cast(Role, role)

    def may_try(self, address: str, now: float) -> bool:
        """Whether `address` may try another token."""
        if len(self._tries) > 1000:
            self._tries.clear()
        recent = [t for t in self._tries.get(address, []) if t > now - PAIR_WINDOW_S]
        allowed = len(recent) < PAIR_TRIES
        self._tries[address] = [*recent, now] if allowed else recent
        return allowed

    def role_of(self, headers: dict[str, str]) -> Role | None:
        """Role by bearer token or cookie."""
        scheme, _, token = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return self.role_of_token(token.strip())
        cookies = cookie_parser(headers.get("cookie", ""))
        values = (cookies.get(name, "") for name in (f"__Host-{COOKIE}", COOKIE))
        roles = {self._role_of_session(value) for value in values}
        greatest_first: tuple[Role, ...] = ("supervisor", "operator")
        return next((role for role in greatest_first if role in roles), None)


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
        self._hosts = {f"[{host}]" if ":" in host else host.lower() for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let in or turn away."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        role = self._doors.role_of(headers)
        if not self._admission.may_ask(peer_of(scope), role is not None, now()):
            await _refuse((429, "requests", "fewer"), scope, receive, send)
            return
        refusal = self._refusal(scope, headers, role)
        if refusal is not None:
            await _refuse(refusal, scope, receive, send)
            return
        scope["role"] = role
        await self._app(scope, receive, _with_headers(scope, headers.get("host", ""), send))

    def _refusal(
        self, scope: Scope, headers: dict[str, str], role: Role | None
    ) -> tuple[int, str, str] | None:
        """(status, field, allowed), or None for welcome."""
        host = headers.get("host", "")
        if PORT.sub("", host).lower() not in self._hosts:
            return 421, "Host", "an address of this server"
        bearer = headers.get("authorization", "").lower().startswith("bearer ")
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if changes and not bearer and not self._is_own(scope, headers, host):
            return 403, "Origin", "this server's own pages"
        path: str = scope["path"]
        is_file = path.endswith(PUBLIC_FILES) and not path.startswith("/api/")
        if path in PUBLIC_PATHS or (is_file and not changes):
            return None
        if role is None:
            return 401, "role", "pair first: open the link or scan the QR code"
        if role == "operator" and path not in OPERATOR_PATHS:
            return 403, "role", "supervisor"
        return None

    def _is_own(self, scope: Scope, headers: dict[str, str], host: str) -> bool:
        """A page of another site can neither know our origin nor set our header."""
        scheme = {"ws": "http", "wss": "https"}.get(scope["scheme"], scope["scheme"])
        if headers.get("origin") != f"{scheme}://{host}":
            return False
        return scope["type"] == "websocket" or "x-lightleash" in headers


async def _refuse(
    refusal: tuple[int, str, str], scope: Scope, receive: Receive, send: Send
) -> None:
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
