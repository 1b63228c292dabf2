"""RTP's numbers and times, which begin anywhere and go round (RFC 3550, 5.1). Sans-I/O."""

from __future__ import annotations

from typing import Final

RTP_HZ: Final = 90_000
"""Of the clock of pictures."""
NUMBER_BITS: Final = 16
TIMESTAMP_BITS: Final = 32


def ahead(one: int, other: int, bits: int) -> int:
    """How far `one` is ahead of `other`, the shorter way round the circle of 2^bits (RFC 1982)."""
    half = 1 << bits - 1
    return (one - other + half) % (2 * half) - half
