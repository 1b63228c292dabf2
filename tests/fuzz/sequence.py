"""Several pieces in one input: a length of two bytes before each, as little as must be right."""

import struct
from collections.abc import Sequence

LENGTH = struct.Struct("<H")


def together(parts: Sequence[bytes]) -> bytes:
    """One input of these pieces."""
    return b"".join(LENGTH.pack(len(part)) + part for part in parts)


def pieces(data: bytes) -> list[bytes]:
    """The pieces of an input; the last one may be short."""
    found, at = [], 0
    while at + LENGTH.size <= len(data):
        (length,) = LENGTH.unpack_from(data, at)
        at += LENGTH.size
        found.append(data[at : at + length])
        at += length
    return found
