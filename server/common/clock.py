"""The server's only clock: monotonic, the same for all processes of this machine."""

from __future__ import annotations

import time
from datetime import UTC, datetime


def now() -> float:
    """Seconds since some start [s]; never jumps."""
    return time.monotonic()


def process_cpu() -> float:
    """Processor time of this process [s]."""
    return time.process_time()


def thread_cpu() -> float:
    """Processor time of the thread that asks [s]."""
    return time.thread_time()


def unix_zero_ns() -> int:
    """Calendar's time when `now` was 0 [ns since 1970]; may jump, and be wrong."""
    return time.time_ns() - time.monotonic_ns()


def unix_ms() -> int:
    """Milliseconds of the calendar's time since 1970; may jump, and be wrong."""
    return time.time_ns() // 1_000_000


def utc() -> datetime:
    """Date and time, UTC; may jump."""
    return datetime.now(UTC)


def wall() -> str:
    """Date and time for people, UTC in ISO 8601; may jump."""
    return utc().isoformat(timespec="milliseconds")


def today() -> str:
    """The date where this machine stands, ISO 8601."""
    return datetime.now().date().isoformat()


def file_stamp() -> str:
    """Date and time where this machine stands, for names of files that sort by it."""
    return datetime.now().strftime("%Y%m%d-%H%M%S")
