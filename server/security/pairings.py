"""Who has been let in: one-time links, and the members they were exchanged for. Sans-I/O.

Of links and cookies only SHA-256 digests are kept: who reads the memory or the file of this can't
come in by it, and a look-up tells nothing by the time it takes.
"""

from __future__ import annotations

import base64
import hashlib
import secrets
from collections.abc import Callable, Container, Iterable
from typing import Literal

import msgspec
from msgspec.structs import replace

from server.common.roles import Confirm, Role

State = Literal["waiting", "in", "denied", "revoked", "expired"]
LINK_S = 600.0
"""A link opens for so long."""
WAIT_S = 300.0
"""Whom nobody has confirmed within this is turned away."""
IDLE_S = 12 * 3600.0
"""A session that nobody has used for so long has ended."""
MAX_LINKS, MAX_MEMBERS, MAX_ENDED = 64, 32, 64
"""The oldest link and ended member are forgotten; another member is refused."""
KEY_BYTES = 16
LETTERS = "BCDFGHJKLMNPQRSTVWXZ"
"""Of match codes: without vowels they spell nothing, without Y and I they are not misread."""
CODE_LETTERS = 4  # two people compare them in a glance
MAX_NAME = 40  # letters


class PairingError(Exception):
    """A link or a request that can't be taken; says which field and what is allowed."""

    def __init__(self, field: str, allowed: str) -> None:
        """Refuse in words for the person who can mend it."""
        super().__init__(f"{field}: {allowed}")
        self.field, self.allowed = field, allowed


class PairingLink(msgspec.Struct):
    """A link that was handed out."""

    role: Role
    expires: float
    """[s]"""
    used: bool = False
    by: str = ""
    """Id of whoever made it."""


class Member(msgspec.Struct, frozen=True):
    """Somebody who has exchanged a link."""

    id: str
    """Names it in lists; opens nothing."""
    name: str
    role: Role
    state: State
    code: str
    """Four letters that stand on both screens while a supervisor has to confirm."""
    since: float
    """[s]"""
    address: str
    """Where it was paired from."""
    digest: str = ""
    """Of its cookie; "" for programs that bring the key of the run."""
    why: str = ""
    """Why it has ended, in words."""


def of_this_machine(role: Role, address: str = "", since: float = 0.0) -> Member:
    """A program of the user who runs the server: it brings a key of the run file."""
    return Member(f"local-{role}", f"local program ({role})", role, "in", "", since, address)


class Book(msgspec.Struct):
    """Contents of the file that outlives the server process."""

    links: dict[str, PairingLink] = {}
    members: dict[str, Member] = {}


class Pairings:
    """Links that were handed out and whom they let in."""

    def __init__(
        self,
        confirm: Confirm = "supervisor",
        random: Callable[[int], bytes] = secrets.token_bytes,
        book: Book | None = None,
    ) -> None:
        """`confirm` says who confirms an operator; nobody has come yet, or those in `book`."""
        self._confirm, self._random = confirm, random
        self.book = book or Book()
        self._used: dict[str, float] = {}

    def _key(self) -> str:
        return base64.urlsafe_b64encode(self._random(KEY_BYTES)).rstrip(b"=").decode()

    def invite(self, role: Role, now: float, by: str = "") -> str:
        """A new link's key, made by the member with that id: opens once, within `LINK_S`."""
        key, links = self._key(), self.book.links
        links[digest_of(key)] = PairingLink(role, now + LINK_S, by=by)
        while len(links) > MAX_LINKS:
            del links[next(iter(links))]
        return key

    def opens(self, key: str, now: float) -> tuple[Role, bool]:
        """The role that a link gives, and whether a supervisor has to confirm it.

        Raises:
            PairingError: never handed out, used, or expired.
        """
        role = self._link(key, now).role
        return role, role == "operator" and self._confirm == "supervisor"

    def _link(self, key: str, now: float) -> PairingLink:
        link = self.book.links.get(digest_of(key))
        if link is None:
            raise PairingError("token", "a link of this run: scan the newest code")
        if link.used:
            raise PairingError("token", "a link works once, and this one was used: scan a new code")
        if now >= link.expires:
            raise PairingError("token", f"a link lives {LINK_S / 60:g} minutes: scan a new code")
        return link

    def pair(
        self, key: str, name: str, address: str, now: float, instead_of: str = ""
    ) -> tuple[Member, str]:
        """Exchange a link's key for a session and the value of its cookie.

        It may be `instead_of` the member with that id, whose place and name it takes: whoever pairs
        anew is no other person.

        Raises:
            PairingError: never handed out, used, expired, or too many are here.
        """
        link, (_, waits) = self._link(key, now), self.opens(key, now)
        others = [one for one in self.present() if one.id != instead_of]
        if len(others) >= MAX_MEMBERS:
            raise PairingError("token", f"at most {MAX_MEMBERS} at a time: revoke somebody")
        link.used = True
        cookie = self._key()
        member = Member(
            id=self._key()[:8],
            name=_free_name(name, {one.name for one in others}),
            role=link.role,
            state="waiting" if waits else "in",
            code=self._free_code() if waits else "",
            since=now,
            address=address,
            digest=digest_of(cookie),
        )
        self.book.members[member.id] = member
        self._used[member.id] = now
        return member, cookie

    def _free_code(self) -> str:
        taken = {one.code for one in self.present()}
        while True:
            number = int.from_bytes(self._random(8), "big")
            letters = [LETTERS[number // len(LETTERS) ** n % len(LETTERS)] for n in range(4)]
            if (code := "".join(letters)) not in taken:
                return code

    def of_cookie(self, value: str, now: float) -> Member | None:
        """Member whose cookie it is, in whatever state; that counts as using it."""
        digest = digest_of(value)
        found = next((m for m in self.book.members.values() if m.digest == digest), None)
        if found is not None:
            self._used[found.id] = now
        return found

    def present(self) -> list[Member]:
        """Members who are in or wait, oldest first."""
        return [m for m in self.book.members.values() if m.state in ("waiting", "in")]

    def confirm(self, id: str, code: str) -> Member:
        """Let one in who waits; `code` is what stands on both screens.

        Raises:
            PairingError: nobody waits under this id, or it is another code.
        """
        waiting = self._one(id, "waiting")
        if not secrets.compare_digest(waiting.code.encode(), code.encode("utf-8", "replace")):
            raise PairingError("code", "the four letters on that phone's screen")
        return self._put(replace(waiting, state="in", code=""))

    def deny(self, id: str, why: str) -> Member:
        """Turn one away who waits.

        Raises:
            PairingError: nobody waits under this id.
        """
        return self._put(replace(self._one(id, "waiting"), state="denied", code="", why=why))

    def revoke(self, id: str, why: str) -> Member:
        """End a session: its cookie opens nothing any more, nor do unused links that it made.

        Raises:
            PairingError: nobody is in, or waits, under this id.
        """
        ended = replace(self._one(id, "waiting", "in"), state="revoked", code="", why=why)
        links = self.book.links
        for digest in [key for key, link in links.items() if link.by == id and not link.used]:
            del links[digest]
        return self._put(ended)

    def expire(self, now: float, busy: Iterable[str] = ()) -> list[Member]:
        """End those who waited or were idle for too long; who is `busy` is not. Gives them.

        When somebody of the book was last here is not kept: a server started anew counts from then.
        """
        for id in busy:
            self._used[id] = now
        late = []
        for one in self.present():
            if one.state == "waiting" and now >= one.since + WAIT_S:
                late.append(replace(one, state="expired", code="", why="Nobody confirmed it."))
            elif one.state == "in" and now >= self._used.setdefault(one.id, now) + IDLE_S:
                late.append(replace(one, state="expired", why="It was not used for long."))
        return [self._put(one) for one in late]

    def _one(self, id: str, *states: State) -> Member:
        found = self.book.members.get(id)
        if found is None or found.state not in states:
            raise PairingError("id", f"of somebody who is {' or '.join(states)}")
        return found

    def _put(self, member: Member) -> Member:
        """Those who have ended are remembered for a while, to tell them why."""
        members = self.book.members
        members[member.id] = member
        ended = [m.id for m in members.values() if m.state not in ("waiting", "in")]
        for id in ended[: max(0, len(ended) - MAX_ENDED)]:
            del members[id]
            self._used.pop(id, None)
        return member


def _free_name(name: str, taken: Container[str]) -> str:
    wanted = printable(name)[:MAX_NAME].strip() or "someone"
    numbered = (f"{wanted} {n}" for n in range(2, MAX_MEMBERS + 2))
    return wanted if wanted not in taken else next(n for n in numbered if n not in taken)


def digest_of(key: str) -> str:
    """Digest that is kept of a link or a cookie."""
    return hashlib.sha256(key.encode("utf-8", "replace")).hexdigest()


def printable(text: str) -> str:
    """Strip anything that moves a cursor, turns the writing round or is not seen."""
    return "".join(c if c.isprintable() else "·" for c in text)
