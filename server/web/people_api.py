"""Requests by which people come in, are let in or shut out, and hand the lead on."""

from __future__ import annotations

import io
from collections.abc import Awaitable, Callable, Sequence
from typing import Annotated, TypeVar

import msgspec
import segno
from msgspec import Meta
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from server.common.roles import Role, is_enough
from server.security.pairings import LINK_S, Member, PairingError
from server.security.security import PAIR_TRIES, Doors, cookie_name
from server.web.people import LOCAL
from server.web.replies import body_of, refusal
from server.web.session_manager import SessionManager

Wanted = TypeVar("Wanted", bound=msgspec.Struct)
Answer = Callable[[Wanted, Member], Awaitable[Response]]
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


class PeopleApi:
    """Pairing, confirming, shutting out, handing on."""

    def __init__(self, manager: SessionManager, doors: Doors, phones: str, here: str = "") -> None:
        """`phones` is where phones reach this server, `here` where this machine does."""
        self._manager, self._doors, self._phones, self._here = manager, doors, phones, here

    def routes(self) -> Sequence[BaseRoute]:
        """All routes of pairing."""
        roles = '{"role": "viewer", "operator" or "supervisor"}'
        id, code = '{"id": "…"}', '{"id": "…", "code": "…"}'
        return [
            Route("/api/pair", self._pair, methods=["POST"]),
            Route("/api/whoami", self._who_am_i),
            self._of_a_member("/api/invite", InviteRequest, roles, self._invite),
            self._of_a_member("/api/people/confirm", PersonRequest, code, self._confirm),
            self._of_a_member("/api/people/deny", PersonRequest, id, self._deny),
            self._of_a_member("/api/people/revoke", PersonRequest, id, self._revoke),
            self._of_a_member("/api/people/lead", PersonRequest, id, self._lead),
            self._of_a_member("/api/people/keep", PersonRequest, id, self._keep),
        ]

    async def _pair(self, request: Request) -> Response:
        address = request.client.host if request.client is not None else ""
        if not self._doors.may_try(address):
            return refusal(429, "token", f"{PAIR_TRIES} wrong links a minute")
        asked = await _asked(request, PairingRequest)
        if asked is None:
            return refusal(400, "token", 'JSON: {"token": "…", "name": "…"}')
        doors, secure = self._doors, request.url.scheme == "https"
        former = self._former(request, secure)
        try:
            role, must_wait = doors.pairings.opens(asked.token, doors.clock())
            if not asked.replace and former is not None and _loses(former, role, must_wait):
                return _told_of_less(former, role, must_wait)
            member, cookie = doors.pairings.pair(asked.token, asked.name, address, doors.clock())
        except PairingError as error:
            doors.tried(address)
            doors.audit.note("refusal", address=address, why=f"pairing: {error.allowed}")
            return refusal(401, error.field, error.allowed)
        if former is not None:  # its old cookie is of no more use
            await self._manager.handover.shut_out(former.id, "It has paired anew.", former)
        doors.save()
        self._manager.people.note("pair", member, f"as {member.state}")
        unconfirmed = ", waits to be confirmed" if member.state == "waiting" else ""
        self._manager.log_event(f"{member.name} has paired as {member.role}{unconfirmed}.")
        response = JSONResponse(_told(member))
        name = cookie_name(secure)
        response.set_cookie(name, cookie, httponly=True, secure=secure, samesite="strict")
        return response

    def _former(self, request: Request, secure: bool) -> Member | None:
        """Member that a browser that pairs anew has been until now."""
        value = request.cookies.get(cookie_name(secure), "")
        former = self._doors.pairings.of_cookie(value, self._doors.clock()) if value else None
        return former if former is not None and former.state in ("waiting", "in") else None

    async def _who_am_i(self, request: Request) -> Response:
        return JSONResponse(_told(_member(request)))

    def _of_a_member(
        self, path: str, kind: type[Wanted], needs: str, answer: Answer[Wanted]
    ) -> Route:
        """A request with a body; `needs` says which, as JSON."""

        async def endpoint(request: Request) -> Response:
            asked, by = await _asked(request, kind), _member(request)
            if asked is None:
                return refusal(400, kind.__struct_fields__[0], f"JSON: {needs}")
            try:
                return await answer(asked, by)
            except PairingError as error:
                return refusal(409, error.field, error.allowed)

        return Route(path, endpoint, methods=["POST"])

    async def _invite(self, asked: InviteRequest, by: Member) -> Response:
        if asked.role == "supervisor" and not by.id.startswith(LOCAL):
            return refusal(403, "role", "viewer, operator; lightleash invite makes the other one")
        key = self._doors.pairings.invite(asked.role, self._doors.clock(), by.id)
        self._doors.save()
        self._manager.people.note("invite", by, asked.role)
        page = "/" if asked.role == "operator" else "/supervisor"
        url = f"{self._phones}{page}#k={key}"
        here = f"{self._here}{page}#k={key}" if self._here else url
        return JSONResponse({"url": url, "here": here, "qr_svg": _code(url), "lives_s": LINK_S})

    async def _confirm(self, asked: PersonRequest, by: Member) -> Response:
        member = self._doors.pairings.confirm(asked.id, asked.code)
        self._doors.save()
        self._manager.people.note("confirm", by, member.name)
        self._manager.log_event(f"{by.name} let {member.name} in.")
        return JSONResponse({"name": member.name})

    async def _deny(self, asked: PersonRequest, by: Member) -> Response:
        member = self._doors.pairings.deny(asked.id, "A supervisor did not let it in.")
        self._doors.save()
        self._manager.people.note("deny", by, member.name)
        self._manager.log_event(f"{by.name} did not let {member.name} in.")
        return JSONResponse({"name": member.name})

    async def _revoke(self, asked: PersonRequest, by: Member) -> Response:
        if asked.id.startswith(LOCAL):
            return refusal(409, "id", "a paired page; end the program on its computer instead")
        why = "A supervisor has ended this pairing."
        member = await self._manager.handover.shut_out(asked.id, why, by)
        return JSONResponse({"name": member.name})

    async def _lead(self, asked: PersonRequest, by: Member) -> Response:
        self._manager.handover.give(asked.id, by, self._doors.clock())
        return JSONResponse({"leads_next": asked.id}, 202)

    async def _keep(self, asked: PersonRequest, by: Member) -> Response:
        self._manager.handover.keep(asked.id, by, self._doors.clock())
        return JSONResponse({"leads_next": ""}, 202)


def _loses(former: Member, role: Role, waits: bool) -> bool:
    """Whether `former` would do less under a link of `role`, now or once it is confirmed."""
    return former.state == "in" and (
        not is_enough(role, former.role) or (waits and role == former.role)
    )


def _told_of_less(former: Member, role: Role, waits: bool) -> Response:
    body = {
        "code": "paired",
        "field": "replace",
        "allowed": f"true, to give up being paired as {former.role}",
        "held": former.role,
        "offered": role,
        "waits": waits,
    }
    return JSONResponse(body, 409)


def _member(request: Request) -> Member:
    member: Member = request.scope["member"]
    return member


def _told(member: Member) -> dict[str, str]:
    """What a page may know of its own pairing."""
    return {field: getattr(member, field) for field in ("role", "state", "name", "code", "why")}


async def _asked(request: Request, kind: type[Wanted]) -> Wanted | None:
    try:
        return msgspec.json.decode(await body_of(request), type=kind)
    except msgspec.MsgspecError:
        return None


def _code(url: str) -> str:
    svg = io.BytesIO()
    segno.make(url, error="m").save(
        svg, kind="svg", scale=6, border=2, dark="#000", light="#fff", xmldecl=False
    )
    return svg.getvalue().decode()
