"""Requests by which people come in, are let in or shut out, and hand the lead on."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Annotated

import msgspec
import segno
from msgspec import Meta
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute

from server.common.roles import Role, is_enough
from server.security.least_role import Known, Operator, RefusedRequest, Supervisor
from server.security.pairings import LINK_S, Member, PairingError, State
from server.security.security import PAIR_TRIES, Doors, cookie_name
from server.web.people import LOCAL
from server.web.session_manager import SessionManager
from server.web.typed_routes import ApiRoute, Asked, Reply

Short = Annotated[str, Meta(max_length=64)]


class PairingRequest(msgspec.Struct, forbid_unknown_fields=True):
    """What `/api/pair` is asked."""

    token: Short
    name: Short = ""
    replace: bool = False
    """Give up for it what this browser may already."""


class InviteRequest(msgspec.Struct, forbid_unknown_fields=True):
    """What `/api/invite` is asked."""

    role: Role = "operator"


class PersonRequest(msgspec.Struct, forbid_unknown_fields=True):
    """Body of a request about a person."""

    id: Short
    code: Short = ""


class PairAnswer(msgspec.Struct):
    """What a page may know of its own pairing."""

    role: Role
    state: State
    name: str
    code: str
    """Four letters that a supervisor has to find equal."""
    why: str
    """It has ended, in words."""

    @classmethod
    def of(cls, member: Member) -> PairAnswer:
        """That of `member`."""
        return cls(member.role, member.state, member.name, member.code, member.why)


class InviteAnswer(msgspec.Struct):
    """A link that opens once."""

    url: str
    here: str
    """The same for a browser on the server's own machine."""
    qr_svg: str
    lives_s: float = LINK_S


class PersonAnswer(msgspec.Struct):
    """Whom it was done to."""

    name: str


class LeadAnswer(msgspec.Struct):
    """Whose the lead is next."""

    leads_next: str
    """Id; "" of nobody in particular."""


class PeopleApi:
    """Pairing, confirming, shutting out, handing on."""

    def __init__(self, manager: SessionManager, doors: Doors, phones: str, here: str = "") -> None:
        """`phones` is where phones reach this server, `here` where this machine does."""
        self._manager, self._doors, self._phones, self._here = manager, doors, phones, here

    def routes(self) -> Sequence[BaseRoute]:
        """All routes of pairing."""
        post = ["POST"]
        return [
            ApiRoute("/api/pair", self._pair, methods=post, response_model=Reply[PairAnswer]),
            ApiRoute("/api/whoami", self._who_am_i),
            ApiRoute("/api/invite", self._invite, methods=post),
            ApiRoute("/api/people/confirm", self._confirm, methods=post),
            ApiRoute("/api/people/deny", self._deny, methods=post),
            ApiRoute("/api/people/revoke", self._revoke, methods=post),
            ApiRoute("/api/people/lead", self._lead, methods=post, status_code=202),
            ApiRoute("/api/people/keep", self._keep, methods=post, status_code=202),
        ]

    async def _pair(self, request: Request, asked: Asked[PairingRequest]) -> Response:
        """Exchange a link for a cookie."""
        address = request.client.host if request.client is not None else ""
        doors, secure = self._doors, request.url.scheme == "https"
        if not doors.may_try(address):
            raise RefusedRequest(429, "token", f"{PAIR_TRIES} wrong links a minute")
        name = cookie_name(secure, request.headers.get("host", ""))
        former = self._former(request.cookies.get(name, ""))
        try:
            role, must_wait = doors.pairings.opens(asked.token, doors.clock())
            if not asked.replace and former is not None and _loses(former, role, must_wait):
                return _role_conflict(former, role, must_wait)
            instead_of = former.id if former is not None else ""
            member, cookie = doors.pairings.pair(
                asked.token, asked.name, address, doors.clock(), instead_of
            )
        except PairingError as error:
            doors.tried(address)
            doors.audit.note("refusal", address=address, why=f"pairing: {error.allowed}")
            raise RefusedRequest(401, error.field, error.allowed) from error
        if former is not None:  # its old cookie is of no more use
            await self._manager.handover.shut_out(former.id, "It has paired anew.", former)
        doors.save()
        self._manager.people.note("pair", member, f"as {member.state}")
        unconfirmed = ", waits to be confirmed" if member.state == "waiting" else ""
        self._manager.log_event(f"{member.name} has paired as {member.role}{unconfirmed}.")
        response = JSONResponse(msgspec.to_builtins(PairAnswer.of(member)))
        response.set_cookie(name, cookie, httponly=True, secure=secure, samesite="strict")
        return response

    def _former(self, value: str) -> Member | None:
        """Member that a browser that pairs anew has been until now, by its cookie."""
        former = self._doors.pairings.of_cookie(value, self._doors.clock()) if value else None
        return former if former is not None and former.state in ("waiting", "in") else None

    async def _who_am_i(self, by: Known) -> Reply[PairAnswer]:
        """As what a page is paired."""
        return PairAnswer.of(by)

    async def _invite(self, asked: Asked[InviteRequest], by: Supervisor) -> Reply[InviteAnswer]:
        """Make a link, and its QR code."""
        if asked.role == "supervisor" and not by.id.startswith(LOCAL):
            allowed = "viewer, operator; lightleash invite makes the other one"
            raise RefusedRequest(403, "role", allowed)
        key = self._doors.pairings.invite(asked.role, self._doors.clock(), by.id)
        self._doors.save()
        self._manager.people.note("invite", by, asked.role)
        page = "/" if asked.role == "operator" else "/supervisor"
        url = f"{self._phones}{page}#k={key}"
        here = f"{self._here}{page}#k={key}" if self._here else url
        return InviteAnswer(url, here, _code(url))

    async def _confirm(self, asked: Asked[PersonRequest], by: Supervisor) -> Reply[PersonAnswer]:
        """Let in who waits, by the letters on both screens."""
        member = self._doors.pairings.confirm(asked.id, asked.code)
        self._doors.save()
        self._manager.people.note("confirm", by, member.name)
        self._manager.log_event(f"{by.name} let {member.name} in.")
        return PersonAnswer(member.name)

    async def _deny(self, asked: Asked[PersonRequest], by: Supervisor) -> Reply[PersonAnswer]:
        """Turn away who waits."""
        member = self._doors.pairings.deny(asked.id, "A supervisor did not let it in.")
        self._doors.save()
        self._manager.people.note("deny", by, member.name)
        self._manager.log_event(f"{by.name} did not let {member.name} in.")
        return PersonAnswer(member.name)

    async def _revoke(self, asked: Asked[PersonRequest], by: Supervisor) -> Reply[PersonAnswer]:
        """Shut out who is in."""
        if asked.id.startswith(LOCAL):
            allowed = "a paired page; end the program on its computer instead"
            raise PairingError("id", allowed)
        why = "A supervisor has ended this pairing."
        return PersonAnswer((await self._manager.handover.shut_out(asked.id, why, by)).name)

    async def _lead(self, asked: Asked[PersonRequest], by: Operator) -> Reply[LeadAnswer]:
        """Hand the lead on."""
        self._manager.handover.give(asked.id, by, self._doors.clock())
        return LeadAnswer(asked.id)

    async def _keep(self, asked: Asked[PersonRequest], by: Operator) -> Reply[LeadAnswer]:
        """Keep the lead, or leave it to whom it was not given."""
        self._manager.handover.keep(asked.id, by, self._doors.clock())
        return LeadAnswer("")


def _loses(former: Member, role: Role, waits: bool) -> bool:
    """Whether `former` would do less under a link of `role`, now or once it is confirmed."""
    return former.state == "in" and (
        not is_enough(role, former.role) or (waits and role == former.role)
    )


def _role_conflict(former: Member, role: Role, waits: bool) -> Response:
    body = {
        "code": "paired",
        "field": "replace",
        "allowed": f"true, to give up being paired as {former.role}",
        "held": former.role,
        "offered": role,
        "waits": waits,
    }
    return JSONResponse(body, 409)


def _code(url: str) -> str:
    svg = io.BytesIO()
    segno.make(url, error="m").save(
        svg, kind="svg", scale=6, border=2, dark="#000", light="#fff", xmldecl=False
    )
    return svg.getvalue().decode()
