"""Packets of MAVLink 1 and 2 as they come in a datagram: bytes ↔ message, sender and payload.

| bytes | MAVLink 2                                              | MAVLink 1      |
|-------|--------------------------------------------------------|----------------|
| 1     | 0xFD                                                   | 0xFE           |
| 1     | bytes of the payload                                   | the same       |
| 1     | incompatible flags: 1 signed, others are not known     | none           |
| 1     | compatible flags                                       | none           |
| 1     | sequence                                               | the same       |
| 1     | system                                                 | the same       |
| 1     | component                                              | the same       |
| 3     | message, little-endian                                 | 1 byte         |
| n     | payload; zeros at its end may be missing               | whole          |
| 2     | CRC-16/MCRF4XX of all since the second byte, then of one that is the message's own    ||
| 13    | signature, if the flags say so; no one here has its key | none          |

We say MAVLink 2, by which an autopilot that still says MAVLink 1 learns to. A message that is not
known can't be checked, for its own byte isn't known either: it is passed over by its length.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Iterator
from dataclasses import dataclass

from hardware.link.mavlink.messages import LAYOUTS, MessageLayout

MAGIC, OLD_MAGIC = 0xFD, 0xFE  # a packet's first byte
HEAD, OLD_HEAD = 10, 6  # bytes before the payload
CRC, SIGNATURE = 2, 13  # bytes behind it
SIGNED = 1  # the flag
LOW = 0xFF  # mask of a byte
MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
"""Each byte with its last bit first."""


@dataclass(frozen=True, slots=True)
class MavlinkPacket:
    """A message whose CRC is right."""

    system: int
    component: int
    message: int
    """A key of `LAYOUTS`."""
    values: tuple[float, ...]
    """Its fields in the order of its bytes; those that an older sender does not know are zero."""


def encoded(packet: MavlinkPacket, sequence: int) -> bytes:
    """The bytes of a packet of MAVLink 2."""
    layout = LAYOUTS[packet.message]
    payload = layout.fields.pack(*packet.values).rstrip(b"\0") or b"\0"
    head = bytes((len(payload), 0, 0, sequence & LOW, packet.system, packet.component))
    body = head + packet.message.to_bytes(3, "little") + payload
    return bytes((MAGIC,)) + body + _crc(body, layout)


def packets(data: bytes) -> Iterator[MavlinkPacket | None]:
    """The messages of a datagram that are known; None for each place where there is none."""
    while data:
        head = HEAD if data[0] == MAGIC else OLD_HEAD
        if data[0] not in (MAGIC, OLD_MAGIC) or len(data) < head:
            yield None
            return
        flags = data[2] if head == HEAD else 0
        ends = head + data[1] + CRC
        after = ends + (SIGNATURE if flags & SIGNED else 0)
        if flags & ~SIGNED or after > len(data):
            yield None
            return
        packet, data = data[:ends], data[after:]
        message = int.from_bytes(packet[7:head] if head == HEAD else packet[5:head], "little")
        if message in LAYOUTS:
            yield _checked(packet, head, message)


def _checked(packet: bytes, head: int, message: int) -> MavlinkPacket | None:
    layout, payload = LAYOUTS[message], packet[head:-CRC]
    if packet[-CRC:] != _crc(packet[1:-CRC], layout):
        return None
    if head == OLD_HEAD and len(payload) < layout.least:
        return None
    system, component = packet[5:7] if head == HEAD else packet[3:5]
    return MavlinkPacket(system, component, message, layout.read(payload))


def _crc(body: bytes, layout: MessageLayout) -> bytes:
    """CRC-16/MCRF4XX takes the last bit of each byte first; Python has the one that does not."""
    mirrored = crc_hqx((body + bytes((layout.crc_extra,))).translate(MIRRORED), 0xFFFF)
    return bytes((MIRRORED[mirrored >> 8], MIRRORED[mirrored & LOW]))
