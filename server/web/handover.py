"""The lead passes from one person to another, or is lost: the robot is disarmed each time."""

from __future__ import annotations

import asyncio
from typing import Protocol

from server.phone.phone_session import PhoneSession
from server.security.pairings import Member, PairingError
from server.security.security import UNSAVED
from server.web.people import People


class LeadSubject(Protocol):
    """What is led: the session manager."""

    phone: PhoneSession | None
    people: People

    def is_flying(self) -> bool:
        """Whether the robot may be in the air, as far as is known."""

    def disarm(self) -> None:
        """Bring the robot down, whoever leads."""

    def disconnect_phone(self, phone: PhoneSession) -> None:
        """A phone has gone."""

    def log_event(self, text: str) -> None:
        """An event that people should see."""


class Handover:
    """Changes of who leads, beside those by phones that come and go."""

    def __init__(self, manager: LeadSubject) -> None:
        """Hand over the lead that `manager` keeps."""
        self._manager = manager

    def give(self, to: str, by: Member, now: float) -> None:
        """Give the lead to the member with that id; a robot in flight comes down first.

        Raises:
            PairingError: `by` may not, nobody may lead under this id, or the robot flies.
        """
        manager, people = self._manager, self._manager.people
        heir, is_flying = people.named(to), manager.is_flying()
        if by.role != "supervisor" and by.id != people.lease.holder:
            raise PairingError("role", "supervisor, or who leads now")
        if heir is None or heir.role == "viewer":
            raise PairingError("id", "of an operator who is let in")
        if heir.id == people.lease.holder:
            raise PairingError("id", "of somebody else: this one leads already")
        if by.role != "supervisor" and is_flying:
            raise PairingError("mode", "while the robot is disarmed: disarm it first")
        people.note("take-over" if is_flying else "hand-over", by, heir.name)
        manager.log_event(f"{by.name} gives the lead to {heir.name}.")
        people.lease.give(to, now)
        manager.disarm()
        self.make_room(now)

    def keep(self, id: str, by: Member, now: float) -> None:
        """Keep the lead no longer for the member with that id.

        Raises:
            PairingError: it is not kept for that one, or is none of the business of `by`.
        """
        people, lease = self._manager.people, self._manager.people.lease
        if lease.next_of(now) != id:
            raise PairingError("id", "of whom the lead is kept for")
        if by.role != "supervisor" and by.id != id and lease.is_of_another(by.id):
            raise PairingError("role", "supervisor, who gave it, or whom it is kept for")
        heir = people.named(id)
        people.note("hand-over", by, f"ended before {heir.name if heir else id} took it")
        self._manager.log_event(f"{by.name} ends the hand-over to {heir.name if heir else id}.")
        lease.forget(id)

    def make_room(self, now: float) -> None:
        """Who leads goes, when the robot is down, for whom the lead was given to."""
        manager, lease = self._manager, self._manager.people.lease
        heir = lease.next_of(now)
        if not heir or manager.phone is None or lease.holder == heir:
            return
        if manager.is_flying():
            lease.give(heir, now)
        else:
            manager.disconnect_phone(manager.phone)

    async def shut_out(self, id: str, why: str, by: Member) -> Member:
        """End a pairing: its sockets close now, and a robot that it leads comes down.

        Raises:
            PairingError: nobody is in under this id.
        """
        people = self._manager.people
        member = people.doors.pairings.revoke(id, why)
        people.note("revoke", by, f"{member.name}: {why}")
        self._manager.log_event(f"{member.name} is shut out. {why}")
        await self._expel([member])
        return member

    async def expire(self) -> None:
        """Those whose time is over go; who has gone is written down, if that could not be done."""
        if self._manager.people.doors.save_again():
            self._manager.log_event("Who is paired is written down again.")
        over = self._manager.people.expire()
        for member in over:
            self._manager.log_event(f"{member.name} is not paired any more. {member.why}")
        if over:
            await self._expel(over)

    async def _expel(self, members: list[Member]) -> None:
        """The robot comes down before anybody waits for a disk or a page."""
        doors = self._manager.people.doors
        for member in members:
            self._take_the_lead_from(member)
        try:
            await asyncio.gather(*(doors.sockets.end(member.id) for member in members))
        finally:
            if not doors.save():
                self._manager.log_event(UNSAVED)
        for member in members:
            if all(other.address != member.address for other in doors.pairings.present()):
                doors.on_gone(member.address)

    def _take_the_lead_from(self, member: Member) -> None:
        manager, people = self._manager, self._manager.people
        people.lease.forget(member.id)
        if people.lease.holder == member.id and manager.phone is not None:
            manager.disarm()
            manager.disconnect_phone(manager.phone)
