"""Everybody who is paired or connected, who leads, and what each has done."""

from __future__ import annotations

from collections.abc import Callable

from server.common.roles import Role
from server.protocol.people_messages import Deed, Person
from server.security.pairings import Member, of_this_machine
from server.security.security import Doors
from server.web.lease import Lease

LOCAL = "local-"
"""How the ids of programs begin that bring a key of the run."""


class People:
    """People whom the doors have let in, as the session manager sees them."""

    def __init__(self, doors: Doors, keep: Callable[[Deed], object]) -> None:
        """`keep` puts a deed into the running recording."""
        self.doors, self._keep = doors, keep
        self.lease = Lease()
        self._local: dict[str, tuple[Role, float]] = {}

    def note(self, what: str, who: Member | None = None, why: str = "") -> None:
        """Write a deed down."""
        name, role, address = (who.name, who.role, who.address) if who else ("", "", "")
        deed = self.doors.audit.note(what, name, role, address, why)
        if deed is not None:
            self._keep(deed)

    def present(self) -> list[Person]:
        """People for every screen: those who are paired, and programs that are connected."""
        t, connected = self.doors.clock(), set(self.doors.sockets.ids())
        heir = self.lease.next_of(t)
        members = [*self.doors.pairings.present(), *self._programs(connected, t)]
        return [
            Person(
                id=one.id,
                name=one.name,
                role=one.role,
                state="waiting" if one.state == "waiting" else "in",
                code=one.code,
                address=one.address,
                since_s=round(t - one.since, 1),
                connected=one.id in connected,
                leads=one.id == self.lease.holder,
                offered=one.id == heir,
            )
            for one in members
        ]

    def _programs(self, connected: set[str], t: float) -> list[Member]:
        roles: tuple[Role, ...] = ("operator", "supervisor")
        here = {f"{LOCAL}{role}": role for role in roles if f"{LOCAL}{role}" in connected}
        self._local = {id: self._local.get(id, (role, t)) for id, role in here.items()}
        return [of_this_machine(role, since=since) for role, since in self._local.values()]

    def named(self, id: str) -> Member | None:
        """Member who is in under this id."""
        members = [m for m in self.doors.pairings.present() if m.state == "in"]
        members += [of_this_machine(role) for role in ("operator", "supervisor")]
        return next((one for one in members if one.id == id), None)

    def expire(self) -> list[Member]:
        """Put out those whose time is over, and write it down."""
        busy = self.doors.sockets.ids()
        over = self.doors.pairings.expire(self.doors.clock(), busy)
        for one in over:
            self.note("expire", one, one.why)
        return over
