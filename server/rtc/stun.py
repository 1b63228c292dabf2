"""A wall before aioice's reader of STUN: it takes datagrams from anybody.

aioice expects ValueError of what is no STUN message; some that are too short for what they promise
make it raise others, each of which would be a traceback in the log for whoever sends it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from aioice import stun

FAULTS = (struct.error, LookupError, TypeError, AttributeError, OverflowError)


def walled(parse: Callable[[bytes], stun.Message]) -> Callable[[bytes], stun.Message]:
    """`parse` that raises nothing but ValueError."""

    def parse_message(data: bytes) -> stun.Message:
        try:
            return parse(data)
        except FAULTS as error:
            raise ValueError(f"no STUN message: {error!r}") from error

    return parse_message


def build_wall() -> None:
    """Once in a process."""
    stun.parse_message = walled(stun.parse_message)  # type: ignore[assignment]
