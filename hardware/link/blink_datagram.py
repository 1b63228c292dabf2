"""The datagram that tells a robot to blink, byte by byte; little-endian, 60 bytes, version 1.

Blink order, control → robot, beside the commands of `datagram.py`; for robots whose file says
`blinks`. Who does not know its magic refuses it as malformed, which changes nothing.

| offset | type     | field                                                                       |
|--------|----------|-----------------------------------------------------------------------------|
| 0      | 4 bytes  | magic `LLbl`                                                                |
| 4      | u8       | version, 1                                                                  |
| 5      | u8       | 0                                                                           |
| 6      | u16      | a slot [ms], 20 to 1000                                                     |
| 8      | u64      | epoch of the control process                                                |
| 16     | u64      | nonce of the newest sample                                                  |
| 24     | u64      | begin, on the robot's monotonic clock [µs], less than 2^60                  |
| 32     | u32      | how long from then on [ms], at most 10 000; afterwards all LEDs shine       |
| 36     | 8 × u8   | which LED is dark in each slot of a round, 255 none                         |
| 44     | 16 bytes | HMAC-SHA-256 of all bytes before, truncated                                 |

What a robot does with it is in `blink_end.py`, and in C in `deploy/watchdog/blink.c`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from hardware.follower import BlinkOrder
from hardware.link.datagram import LinkError, fixed_fields
from hardware.link.link_key import MAC_BYTES, mac
from pipeline.vision.blink_code import SLOTS

MAGIC, VERSION = b"LLbl", 1
LAYOUT = struct.Struct(f"<4sBBHQQQI{SLOTS}B")
BYTES = LAYOUT.size + MAC_BYTES
SHORTEST_MS, LONGEST_MS = 20, 1_000
"""A slot."""
LASTS_MS = 10_000
"""However it ends: a robot that nobody tells to blink shines."""
NO_LED = 255  # in place of an LED: all shine


@dataclass(frozen=True, slots=True)
class BlinkDatagram:
    """Who says so, and what."""

    epoch: int
    nonce: int
    order: BlinkOrder


def encode_blink(said: BlinkDatagram, key: bytes) -> bytes:
    """Encode a blink order."""
    order = said.order
    dark = (NO_LED if led < 0 else led for led in order.dark)
    body = LAYOUT.pack(
        MAGIC,
        VERSION,
        0,
        order.slot_ms,
        said.epoch,
        said.nonce,
        order.begin_us,
        order.lasts_ms,
        *dark,
    )
    return body + mac(key, body)


def decode_blink(data: bytes, key: bytes) -> BlinkDatagram:
    """The blink order in `data`.

    Raises:
        LinkError: not one of this version, not made with the key, or with a value that can't be.
    """
    fields = fixed_fields(data, key, LAYOUT, "blink", MAGIC, VERSION)
    zero, slot_ms, epoch, nonce, begin_us, lasts_ms, *dark = fields
    if zero != 0:
        raise LinkError("blink.zero", "0")
    if not SHORTEST_MS <= slot_ms <= LONGEST_MS or lasts_ms > LASTS_MS or begin_us >= 1 << 60:
        raise LinkError("blink.slot, begin, lasts", "20 to 1000 ms, 0 to 2^60 µs, 0 to 10 000 ms")
    leds = tuple(-1 if led == NO_LED else led for led in dark)
    return BlinkDatagram(epoch, nonce, BlinkOrder(begin_us, lasts_ms, slot_ms, leds))
