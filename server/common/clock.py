"""The server's only clock: monotonic, the same for all processes of this machine."""

from __future__ import annotations

import time
from datetime import UTC, datetime


def now() -> float:
    """Seconds since some start [s]; never jumps."""
    return time.monotonic()


def unix_ms() -> int:
    """Milliseconds of the calendar's time since 1970; may jump, and be wrong."""
    return time.time_ns() // 1_000_000


def wall() -> str:
    """Date and time for people, UTC in ISO 8601; may jump."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
