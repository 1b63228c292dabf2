"""The datagram that tells a robot's tool how far to open, byte by byte; 40 bytes, version 1.

Tool order, control → robot, little-endian, beside the commands of `datagram.py`; for robots whose
file has a `[tool]`. Who does not know its magic refuses it as malformed, which changes nothing.

| offset | type     | field                                                                       |
|--------|----------|-----------------------------------------------------------------------------|
| 0      | 4 bytes  | magic `LLtl`                                                                |
| 4      | u8       | version, 1                                                                  |
| 5      | u8       | 0                                                                           |
| 6      | u16      | how far it shall be open: 0 closed to 10 000                                |
| 8      | u64      | epoch of the control process                                                |
| 16     | u64      | nonce of the newest sample                                                  |
| 24     | 16 bytes | HMAC-SHA-256 of all bytes before, truncated                                 |

What a robot does with it is in `tool_end.py`, and in C in `deploy/watchdog/tool.c`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from hardware.link.datagram import LinkError, fixed_fields
from hardware.link.link_key import MAC_BYTES, mac

MAGIC, VERSION = b"LLtl", 1
LAYOUT = struct.Struct("<4sBBHQQ")
BYTES = LAYOUT.size + MAC_BYTES
OPEN = 10_000  # as far as it goes


@dataclass(frozen=True, slots=True)
class ToolDatagram:
    """Who says so, and what."""

    epoch: int
    nonce: int
    opening: float
    """0 closed to 1 open."""


def encode_tool(said: ToolDatagram, key: bytes) -> bytes:
    """Encode a tool order."""
    opening = round(OPEN * said.opening)
    body = LAYOUT.pack(MAGIC, VERSION, 0, opening, said.epoch, said.nonce)
    return body + mac(key, body)


def decode_tool(data: bytes, key: bytes) -> ToolDatagram:
    """The tool order in `data`.

    Raises:
        LinkError: not one of this version, not made with the key, or with a value that can't be.
    """
    fields = fixed_fields(data, key, LAYOUT, "tool", MAGIC, VERSION)
    zero, opening, epoch, nonce = fields
    if zero != 0:
        raise LinkError("tool.zero", "0")
    if opening > OPEN:
        raise LinkError("tool.opening", f"0 to {OPEN}")
    return ToolDatagram(epoch, nonce, opening / OPEN)
