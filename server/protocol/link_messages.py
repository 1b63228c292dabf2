"""What the server says of the operator's link, as JSON."""

from __future__ import annotations

from typing import Literal

import msgspec

Grade = Literal["good", "fair", "poor", "unknown"]
Side = Literal["link", "phone", "server"]
SIDES: tuple[Side, ...] = ("link", "phone", "server")


class LinkReport(msgspec.Struct, frozen=True):
    """Answer of `GET /api/link`: what it will be like to fly with the operator's link."""

    grade: Grade
    title: str
    """The verdict in words."""
    lines: list[str]
    """What to expect, and why."""
    advice: list[str]
    """What to do about it; empty if there is nothing to do."""
    seconds: float
    """So long was listened to."""
    follows: float
    """Share of the time in which the robot would follow."""
    waits: int
    """How often it would wait, and go on by itself."""
    ends: int
    """How often a flight would end."""
    sides: dict[str, int]
    """Of both: how many by `link`, `phone` (too busy) and `server` (its computer too busy)."""
    gaps: dict[str, int]
    """Silences by length: how many were longer than so many ms."""
    longest_ms: float
    rtt_ms: float | None
    """Median round trip of a PING."""
    rtt_p95_ms: float | None
    lost: float
    """Share of PINGs without an answer."""
    motion_hz: float
    picture_hz: float
    picture_age_ms: float | None
    """Median, at arrival."""
    picture_gap_ms: float | None
    """The longest wait for one."""
