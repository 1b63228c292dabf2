"""Whom a route is for: one dependency per role, and the table that follows from all routes.

A route's role is asked twice, by the same words: by the guard before anything of the body is read,
and by the dependency once the body has come, because a pairing can end while it comes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, HTTPException
from fastapi.openapi.models import HTTPBearer
from fastapi.security.base import SecurityBase
from starlette.requests import HTTPConnection
from starlette.routing import BaseRoute

from server.common.roles import Least, is_enough
from server.security.pairings import Member

PAGES = ("/", "/supervisor", "/board", "/screen", "/fleet", "/check")
PUBLIC = frozenset((*PAGES, "/healthz", "/ca.crt", "/api/pair"))
"""For anyone: the pages, and what brings somebody in."""
PUBLIC_FOLDER, PUBLIC_FILES = "/src", (".js", ".css", ".svg")
"""Of the pages: for anyone to read."""
KEY = "A key of the run file; pages bring the cookie of their pairing instead. At least: "


class RefusedRequest(HTTPException):
    """A request that can't be taken; says which field and what is allowed."""

    def __init__(self, status: int, field: str, allowed: str, code: str = "refused") -> None:
        """In words for the person who can mend it."""
        super().__init__(status, {"code": code, "field": field, "allowed": allowed})
        self.field, self.allowed = field, allowed


def refusal_of(member: Member | None, least: Least) -> RefusedRequest | None:
    """Why `member` may not do what takes `least`, or None for welcome."""
    if least == "anyone":
        return None
    if member is None:
        return RefusedRequest(401, "role", "pair first: open the link or scan the QR code", "role")
    if least == "known":
        return None
    if member.state == "waiting":
        return RefusedRequest(403, "pairing", "once a supervisor has confirmed it")
    if member.state != "in":
        allowed = f"pair anew: this pairing has ended. {member.why}".strip()
        return RefusedRequest(401, "role", allowed, "role")
    return None if is_enough(member.role, least) else RefusedRequest(403, "role", least)


class LeastRole(SecurityBase):
    """A dependency: who asks, who has at least this role."""

    def __init__(self, least: Least, even_shut_out: bool = False) -> None:
        """`even_shut_out` takes the request also of who is shut out while it comes."""
        self.least, self._even_shut_out = least, even_shut_out
        self.scheme_name, self.model = least, HTTPBearer(description=f"{KEY}{least}.")

    async def __call__(self, connection: HTTPConnection) -> Member:
        """Who asks.

        Raises:
            RefusedRequest: not this one, or not any more.
        """
        member: Member | None = connection.scope["member"]
        refused = refusal_of(member, self.least)
        if refused is not None or member is None:
            raise refused or RefusedRequest(401, "role", self.least, "role")
        is_rechecked = self.least != "known" and not self._even_shut_out
        if is_rechecked and not connection.scope["doors"].has_still(member):
            raise RefusedRequest(401, "role", "pair anew: this pairing has ended", "role")
        return member


known, viewer = LeastRole("known"), LeastRole("viewer")
operator, supervisor = LeastRole("operator"), LeastRole("supervisor")
stopper = LeastRole("viewer", even_shut_out=True)
"""STOP is taken of everybody who was in when it began to come."""
Known = Annotated[Member, Depends(known)]
Viewer = Annotated[Member, Depends(viewer)]
Operator = Annotated[Member, Depends(operator)]
Supervisor = Annotated[Member, Depends(supervisor)]
Stopper = Annotated[Member, Depends(stopper)]


@dataclass(frozen=True, slots=True)
class RoleTable:
    """The least role of each path, as the routes themselves declare it."""

    least: Mapping[str, Least]

    def of(self, path: str, is_read: bool) -> Least:
        """The least role that may reach `path`; what is no route is the supervisor's."""
        if is_read and path.endswith(PUBLIC_FILES) and not path.startswith("/api/"):
            return "anyone"
        return self.least.get(path, "supervisor")


def roles_of(routes: Iterable[BaseRoute]) -> RoleTable:
    """The table of these routes.

    Raises:
        ValueError: one says not, or not clearly, whom it is for: our own mistake.
    """
    table: dict[str, Least] = {}
    for route in routes:
        path: str = getattr(route, "path", "")
        public: set[Least] = {"anyone"} if path in PUBLIC else set()
        declared = public | _declared(route)
        if not declared and (path == PUBLIC_FOLDER or path.endswith(PUBLIC_FILES)):
            continue
        if len(declared) != 1 or declared != {table.get(path, *declared)}:
            raise ValueError(f"{path}: one role by its dependency, or PUBLIC; has {declared}")
        [table[path]] = declared
    return RoleTable(table)


def _declared(route: BaseRoute) -> set[Least]:
    dependant = getattr(route, "dependant", None)
    calls = [one.call for one in dependant.dependencies] if dependant is not None else []
    return {call.least for call in calls if isinstance(call, LeastRole)}
