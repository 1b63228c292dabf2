"""Messages that tell who is connected, and what each has done."""

from __future__ import annotations

from typing import Literal

import msgspec

from server.common.roles import Role


class Person(msgspec.Struct, frozen=True):
    """Somebody who is paired, or a program that brings the key of the run."""

    id: str
    name: str
    role: Role
    state: Literal["waiting", "in"]
    """waiting: a supervisor has to confirm."""
    code: str
    """The four letters on the screen of who waits, or ""."""
    address: str
    since_s: float
    """How long ago it was paired."""
    connected: bool
    leads: bool
    offered: bool = False
    """The lead is kept for this one alone, and not yet taken."""


class Deed(msgspec.Struct, tag="deed", frozen=True):
    """Not sent to pages: a line of the audit log, as a recording keeps it."""

    t_s: float
    """On the server's monotonic clock."""
    wall: str
    """UTC, ISO 8601."""
    what: str
    """pair, confirm, deny, revoke, lead, leave, hand-over, arm, disarm, stop, reset, mode, …"""
    who: str
    """Name, or "" for the server itself."""
    role: str
    address: str
    why: str
