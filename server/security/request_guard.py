"""Before every request and websocket: Host, Origin, role, and how much is asked. Pure ASGI."""

from __future__ import annotations

from collections.abc import Iterable
from ipaddress import ip_address

from msgspec.structs import replace
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.common.clock import now
from server.security.admission import LOOPBACK, Admission, RemotePeer, peer_of
from server.security.least_role import RefusedRequest, RoleTable, refusal_of
from server.security.pairings import Member
from server.security.quotas import Asker, Quotas
from server.security.security import PORT, Doors

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
STOP = "/api/stop"
"""Never limited."""


class Guard:
    """Refuses foreign hosts and origins, and those without the role; adds the security headers."""

    def __init__(
        self,
        app: ASGIApp,
        doors: Doors,
        hosts: Iterable[str],
        admission: Admission | None = None,
        quotas: Quotas | None = None,
        roles: RoleTable | None = None,
    ) -> None:
        """`hosts` are the names and addresses this server answers to.

        `admission` is told whose address has shown a role, and limits what strangers ask, `quotas`
        what everybody else does; without `roles` of its routes all is the supervisor's.
        """
        self._app, self._doors = app, doors
        self._admission = Admission() if admission is None else admission
        self._quotas = Quotas() if quotas is None else quotas
        self._roles = RoleTable({}) if roles is None else roles
        doors.on_gone = self._admission.forget
        self._hosts = set(map(as_browsers_write, hosts))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let in or turn away."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        peer = peer_of(scope)
        member = self._doors.who(headers, scope["scheme"] in ("https", "wss"), peer.host)
        is_in = member is not None and member.state == "in"
        refusal = self._refusal(scope, headers, member)
        if not self._admission.may_ask(peer, is_in, now()):
            await _refuse(RefusedRequest(429, "requests", "fewer"), scope, receive, send)
            return
        is_stop = refusal is None and scope["path"] == STOP
        asker = None if is_stop else self._asker(member if is_in else None, peer)
        allowed = self._quotas.may_ask(asker, scope["path"], now())
        refusal = RefusedRequest(429, "requests", allowed) if allowed else refusal
        if refusal is None:
            with self._quotas.place(asker, scope["type"] == "websocket") as allowed:
                if not allowed:
                    await self._serve(scope, receive, send, member, headers.get("host", ""))
                    return
                refusal = RefusedRequest(429, "requests", allowed)
        self._note(refusal, member, peer.host, scope["path"])
        await _refuse(refusal, scope, receive, send)

    async def _serve(
        self, scope: Scope, receive: Receive, send: Send, member: Member | None, host: str
    ) -> None:
        """Hand it to the app, with who asks."""
        address = peer_of(scope).host
        scope["member"] = replace(member, address=address) if member is not None else None
        scope["doors"] = self._doors
        if scope["type"] == "websocket" and member is not None:
            await self._doors.sockets.run(self._app, member.id, scope, receive, send)
        else:
            await self._app(scope, receive, _with_headers(scope, host, send))

    def _asker(self, member: Member | None, peer: RemotePeer) -> Asker | None:
        """Asker whose pool it is; None: the strangers'."""
        if member is not None:
            return Asker("member" if member.digest else "program", member.id)
        if peer.host in LOOPBACK:
            return Asker("loopback", "")
        return Asker("address", peer.host) if self._admission.is_known(peer.host, now()) else None

    def _note(
        self, refusal: RefusedRequest, member: Member | None, address: str, path: str
    ) -> None:
        name, role = (member.name, member.role) if member is not None else ("", "")
        why = f"{path}: {refusal.status_code} {refusal.field}: {refusal.allowed}"
        self._doors.audit.note("refusal", name, role, address, why[:200])

    def _refusal(
        self, scope: Scope, headers: dict[str, str], member: Member | None
    ) -> RefusedRequest | None:
        """Why not, or None for welcome."""
        host = headers.get("host", "")
        if PORT.sub("", host).lower() not in self._hosts:
            return RefusedRequest(421, "Host", "an address of this server")
        bearer = headers.get("authorization", "").lower().startswith("bearer ")
        changes = _changes(scope)
        if changes and not bearer and not self._is_own(scope, headers, host):
            return RefusedRequest(403, "Origin", "this server's own pages")
        return refusal_of(member, self._roles.of(scope["path"], is_read=not changes))

    def _is_own(self, scope: Scope, headers: dict[str, str], host: str) -> bool:
        """A page of another site can neither know our origin nor set our header."""
        scheme = {"ws": "http", "wss": "https"}.get(scope["scheme"], scope["scheme"])
        if headers.get("origin") != f"{scheme}://{host}":
            return False
        return scope["type"] == "websocket" or "x-lightleash" in headers


def as_browsers_write(host: str) -> str:
    """A name or an address as it comes in a Host header, however it was written in the settings."""
    try:
        address = ip_address(host)
    except ValueError:
        return host.lower()
    return f"[{address}]" if address.version == 6 else str(address)


def _changes(scope: Scope) -> bool:
    """Whether it may do more than read."""
    return scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")


async def _refuse(refusal: RefusedRequest, scope: Scope, receive: Receive, send: Send) -> None:
    response = JSONResponse(refusal.detail, refusal.status_code)
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
