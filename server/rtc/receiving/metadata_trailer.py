"""The record behind an encoded picture, as `web_client/src/video/metadata_trailer.js` writes it.

30 bytes, each with its highest bit set, so that neither a start code (00 00 01) nor an emulation of
one can appear: 21 bytes of fields (little-endian) and their CRC-16 in groups of seven, each group
followed by a byte of its highest bits; then three bytes that say that this is a trailer.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from dataclasses import dataclass
from math import sqrt

from server.protocol.wire import WireError
from server.protocol.wire_records import MOST_SHRUNK

FIELDS = struct.Struct("<IqBhhhh")
"""sequence u32, time i64 [µs of the phone's clock], flags u8, orientation w x y z 4 × i16."""
MARK = b"\xcc\xd2\x81"
GROUP = 7  # bytes, then one of their highest bits
RAW_BYTES = FIELDS.size + 2
TRAILER_BYTES = RAW_BYTES + -(-RAW_BYTES // GROUP) + len(MARK)
ONE = 32767.0
HAS_ORIENTATION = 4
"""Flag; the two bits below are the screen's angle in quarter turns."""
SHRUNK = 3
"""The two bits from here on say by how many quarters the page has shrunk the picture."""


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """Record of one image, as the page wrote it."""

    sequence: int
    """Counts the pictures that left the encoder."""
    t_us: int
    """When it was taken, on the phone's clock [µs]."""
    screen_angle_deg: int
    """0, 90, 180 or 270."""
    orientation_wxyz: tuple[float, float, float, float] | None
    """Device to earth, of the newest motion reading."""
    shrunk: int = 0
    """By so many quarters the page has made it smaller than the camera's picture."""


def append(data: bytes, record: FrameRecord) -> bytes:
    """An encoded picture with its record behind it."""
    orientation = record.orientation_wxyz
    flags = record.screen_angle_deg // 90 | (HAS_ORIENTATION if orientation is not None else 0)
    flags |= record.shrunk << SHRUNK
    numbers = [round(ONE * q) for q in orientation or (1.0, 0.0, 0.0, 0.0)]
    fields = FIELDS.pack(record.sequence, record.t_us, flags, *numbers)
    return data + _escaped(fields + crc_hqx(fields, 0).to_bytes(2, "little")) + MARK


def split(data: bytes) -> tuple[bytes, FrameRecord | None]:
    """The picture alone, and its record if it has one.

    Raises:
        WireError: there is one, but with values that can't be.
    """
    if not data.endswith(MARK) or len(data) <= TRAILER_BYTES:
        return data, None
    raw = _plain(data[-TRAILER_BYTES : -len(MARK)])
    fields = raw[: FIELDS.size]
    if raw[FIELDS.size :] != crc_hqx(fields, 0).to_bytes(2, "little"):
        return data, None  # a picture that happens to end so
    return data[:-TRAILER_BYTES], _record(fields)


def _record(fields: bytes) -> FrameRecord:
    sequence, t_us, flags, *numbers = FIELDS.unpack(fields)
    if not 0 <= t_us < 1 << 60:
        raise WireError("value", "trailer.time", "0 to 2^60 µs")
    shrunk = flags >> SHRUNK
    if shrunk > MOST_SHRUNK:
        raise WireError("value", "trailer.flags", f"0 to {(MOST_SHRUNK + 1 << SHRUNK) - 1}")
    orientation = None
    if flags & HAS_ORIENTATION:
        length = sqrt(sum(n * n for n in numbers))
        if not 0.95 * ONE < length < 1.05 * ONE:
            raise WireError("value", "trailer.orientation_wxyz", "a unit quaternion")
        w, x, y, z = (n / length for n in numbers)
        orientation = (w, x, y, z)
    return FrameRecord(sequence, t_us, 90 * (flags & 3), orientation, shrunk)


def _escaped(raw: bytes) -> bytes:
    escaped = bytearray()
    for at in range(0, len(raw), GROUP):
        group = raw[at : at + GROUP]
        escaped += bytes(byte | 0x80 for byte in group)
        escaped.append(0x80 | sum(byte >> 7 << i for i, byte in enumerate(group)))
    return bytes(escaped)


def _plain(escaped: bytes) -> bytes:
    raw = bytearray()
    for at in range(0, len(escaped), GROUP + 1):
        *group, highest = escaped[at : at + GROUP + 1]
        raw += bytes(byte & 0x7F | (highest >> i & 1) << 7 for i, byte in enumerate(group))
    return bytes(raw)
