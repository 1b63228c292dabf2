"""Who may come in: links, cookies and keys."""

from __future__ import annotations

import base64
import contextlib
import hmac
import logging
import re
import secrets
from collections.abc import Callable
from pathlib import Path

import msgspec
from starlette.requests import cookie_parser

from server.common.clock import now
from server.common.roles import Confirm, Role
from server.common.runtime import write_private
from server.security.admission import network_of
from server.security.audit import Audit
from server.security.pairings import Book, Member, Pairings, of_this_machine
from server.security.sockets import Sockets

log = logging.getLogger("lightleash")

COOKIE = "lightleash"
PORT = re.compile(r":(\d{1,5})$")
"""The port at the end of a Host header; an IPv6 address is in brackets."""
PAIR_TRIES, PAIR_WINDOW_S = 10, 60.0
"""So many wrong links of one address in that time."""
MAX_ADDRESSES = 1_000
"""Whose tries are remembered: no flood fills memory."""
SAVE_AGAIN_S = 1.0
UNSAVED = (
    "The disk takes nothing: who is paired can't be written down. It is tried each second; "
    "if the server starts anew before, everybody has to pair again."
)


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
        """Open with a secret of its own by default, and members that are forgotten with it."""
        self._secret = secret or secrets.token_bytes(32)
        self.operator_token = self._sign("token operator")
        self.supervisor_token = self._sign("token supervisor")
        self._store, self.clock = store, clock
        self.pairings = Pairings(confirm, book=_book_in(store))
        self.audit = audit or Audit()
        self.sockets = Sockets()
        self.on_gone: Callable[[str], None] = lambda _: None
        """Called when nobody of an address is in any more."""
        self.is_unsaved = False
        """Who is here is not kept as it is."""
        self._t_saved = 0.0
        self._tries: dict[str, list[float]] = {}

    def save(self) -> bool:
        """Keep who is here: as long as the run, for nobody else to read. False if it can't be kept.

        A disk that is full ends no server. What was kept before goes then, which takes no room: a
        server started anew lets nobody in rather than somebody who was shut out.
        """
        self._t_saved = self.clock()
        if self._store is None:
            return True
        try:
            write_private(self._store, msgspec.json.encode(self.pairings.book).decode())
        except OSError as error:
            log.error("who is paired can't be written down: %s", error)
            self.is_unsaved = True
            with contextlib.suppress(OSError):
                self._store.unlink(missing_ok=True)
            return False
        self.is_unsaved = False
        return True

    def save_again(self) -> bool:
        """Try once more, once a second, what could not be kept; whether it has become kept now."""
        is_due = self.is_unsaved and self.clock() - self._t_saved >= SAVE_AGAIN_S
        return is_due and self.save()

    def _sign(self, text: str) -> str:
        """128 bits that nobody else can make."""
        digest = hmac.digest(self._secret, text.encode(), "sha256")[:16]
        return base64.urlsafe_b64encode(digest).rstrip(b"=").decode()

    def role_of_token(self, token: str) -> Role | None:
        """Role whose key of the run it is, in constant time."""
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
        """Member by the key of a program or the cookie of a page; in whatever state.

        Over TLS only the cookie counts that a browser takes from nobody but us over TLS: another
        one may have been planted by whoever sits between.
        """
        scheme, _, token = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            role = self.role_of_token(token.strip())
            return of_this_machine(role, address) if role is not None else None
        value = cookie_parser(headers.get("cookie", "")).get(
            cookie_name(secure, headers.get("host", "")), ""
        )
        return self.pairings.of_cookie(value, self.clock()) if value else None

    def has_still(self, member: Member) -> bool:
        """Whether a `member` of a moment ago has not been shut out meanwhile."""
        return not member.digest or member.id in {one.id for one in self.pairings.present()}


def cookie_name(secure: bool, host: str) -> str:
    """Name of the session's cookie, over TLS or on this machine.

    Browsers send a cookie to every port of its host: servers of several robots on one machine would
    take each other's place, so the port of their `host` is in it.
    """
    port = PORT.search(host)
    return ("__Host-" if secure else "") + COOKIE + (f"-{port[1]}" if port else "")


def _book_in(store: Path | None) -> Book | None:
    """What a server process before this one has left."""
    if store is None or not store.exists():
        return None
    try:
        return msgspec.json.decode(store.read_bytes(), type=Book)
    except (OSError, msgspec.MsgspecError) as error:
        log.warning("%s can't be read, everybody has to pair again: %s", store, error)
        return None
