"""Every record between a page and the server; the bytes on the wire are the bytes recorded.

Two kinds travel on a websocket: *records* (binary, little-endian: a header of 16 bytes, then a
payload) for what comes often, and *messages* (JSON text, one object with a `type`) for the rest.
`wire_records.py` says what is in a record; `generate.py` generates `PROTOCOL.md` from both.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import IntEnum
from math import isfinite

from server.protocol.wire_records import (
    MOST_SHRUNK,
    Body,
    Codec,
    Credit,
    Motion,
    Picture,
    Ping,
    Pong,
    Record,
    Stamp,
    Thumbnail,
    Touch,
)

VERSION = 2
"""Of the protocol. A page of another version is told so and refused."""

MAGIC = 0x4C  # "L"
HEADER = struct.Struct("<BBBBIq")
"""magic u8, version u8, kind u8, flags u8, sequence u32, time i64 [µs of the sender's clock]."""

KEY_FLAG = 1
"""Of FRAME."""
MAX_RECORD_BYTES = 262_144
MAX_MESSAGE_BYTES = 4_096
MAX_PIXELS = 2_100_000  # of a picture: full HD, and some rows of padding


class WireError(ValueError):
    """A record or message that can't be taken.

    Attributes:
        code: What kind of fault: type, size, version, value, age, order, rate, role or
            calibration.
        field: Which field.
        allowed: What would have been allowed.
    """

    def __init__(self, code: str, field: str, allowed: str) -> None:
        super().__init__(f"{field}: {allowed} ({code})")
        self.code, self.field, self.allowed = code, field, allowed


class Kind(IntEnum):
    """Kinds of record; below 128 from the page, from 128 to the page."""

    MOTION = 1
    FRAME = 2
    TOUCH = 3
    PONG = 4
    STAMP = 5
    PING = 129
    CREDIT = 130
    PICTURE = 131


MOTION = struct.Struct("<10fhH")
FRAME = struct.Struct("<BBHHh")
TOUCH = struct.Struct("<BBHIQ")
PONG = struct.Struct("<Qq")
STAMP = struct.Struct("<I")
PING = struct.Struct("<Q")
CREDIT = struct.Struct("<I")


def encode(record: Record) -> bytes:
    """Encode a record."""
    body, flags = record.body, 0
    match body:
        case Motion():
            kind, flags = Kind.MOTION, int(body.orientation_wxyz is not None)
            orientation = body.orientation_wxyz or (1.0, 0.0, 0.0, 0.0)
            payload = MOTION.pack(
                *body.rotation_rate, *body.acceleration, *orientation, body.screen_angle_deg, 0
            )
        case Picture():
            kind, flags = Kind.FRAME, KEY_FLAG * body.key | body.by_arrival << 3
            size = (body.width, body.height)
            head = FRAME.pack(body.codec, body.shrunk, *size, body.screen_angle_deg)
            payload = head + body.data
        case Touch():
            kind = Kind.TOUCH
            payload = TOUCH.pack(body.held, body.visible, 0, body.press, body.nonce)
        case Pong():
            kind, payload = Kind.PONG, PONG.pack(body.nonce, body.server_time_us)
        case Stamp():
            kind, payload = Kind.STAMP, STAMP.pack(body.rtp_timestamp)
        case Ping():
            kind, payload = Kind.PING, PING.pack(body.nonce)
        case Credit():
            kind, payload = Kind.CREDIT, CREDIT.pack(body.sequence)
        case Thumbnail():
            kind, payload = Kind.PICTURE, body.data
    return HEADER.pack(MAGIC, VERSION, kind, flags, record.sequence, record.t_us) + payload


def decode(data: bytes) -> Record:
    """The record in `data`.

    Raises:
        WireError: wrong size, version, kind or value; says which field and what is allowed.
    """
    if not HEADER.size <= len(data) <= MAX_RECORD_BYTES:
        raise WireError("size", "record", f"{HEADER.size} to {MAX_RECORD_BYTES} bytes")
    magic, version, kind, flags, sequence, t_us = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise WireError("type", "record.magic", f"{MAGIC:#x}")
    if version != VERSION:
        raise WireError("version", "record.version", f"{VERSION}: reload the page")
    _time(t_us)
    decoder = _DECODERS.get(kind)
    if decoder is None:
        raise WireError("type", "record.kind", ", ".join(str(int(k)) for k in _DECODERS))
    return Record(sequence, t_us, decoder(data[HEADER.size :], flags))


def check_frame(record: Record) -> None:
    """Hold a picture that came in another form to the laws of one that came as bytes.

    Raises:
        WireError: as by `decode`.
    """
    if not isinstance(record.body, Picture):
        raise WireError("type", "record.kind", str(int(Kind.FRAME)))
    if size_of(record.body) > MAX_RECORD_BYTES:
        raise WireError("size", "record", f"{HEADER.size} to {MAX_RECORD_BYTES} bytes")
    if not 0 <= record.sequence < 1 << 32:
        raise WireError("value", "record.sequence", "0 to 2^32 - 1")
    _time(record.t_us)
    _picture(record.body)


def size_of(picture: Picture) -> int:
    """How long its record would be [bytes]."""
    return HEADER.size + FRAME.size + len(picture.data)


def _time(t_us: int) -> None:
    if not 0 <= t_us < 1 << 60:
        raise WireError("value", "record.time", "0 to 2^60 µs")


def _unpack(layout: struct.Struct, payload: bytes, name: str) -> tuple[float, ...]:
    if len(payload) != layout.size:
        raise WireError("size", name, f"{layout.size} bytes of payload")
    return layout.unpack(payload)


def _bounded(values: tuple[float, ...], limit: float, field: str, unit: str) -> None:
    if not all(isfinite(v) and abs(v) <= limit for v in values):
        raise WireError("value", field, f"finite, within ±{limit:g} {unit}")


def _angle(value: float, field: str) -> int:
    if value not in (0, 90, 180, 270):
        raise WireError("value", field, "0, 90, 180 or 270")
    return int(value)


def _motion(payload: bytes, flags: int) -> Motion:
    v = _unpack(MOTION, payload, "motion")
    _bounded(v[0:3], 70.0, "motion.rotation_rate", "rad/s")
    _bounded(v[3:6], 320.0, "motion.acceleration", "m/s²")
    orientation = None
    if flags & 1:
        _bounded(v[6:10], 1.01, "motion.orientation_wxyz", "")
        if not 0.9 < sum(q * q for q in v[6:10]) < 1.1:
            raise WireError("value", "motion.orientation_wxyz", "a unit quaternion")
        orientation = (v[6], v[7], v[8], v[9])
    angle = _angle(v[10], "motion.screen_angle_deg")
    return Motion((v[0], v[1], v[2]), (v[3], v[4], v[5]), orientation, angle)


def _frame(payload: bytes, flags: int) -> Picture:
    if len(payload) < FRAME.size:
        raise WireError("size", "frame", f"more than {FRAME.size} bytes of payload")
    codec, shrunk, width, height, angle = FRAME.unpack_from(payload)
    if codec not in Codec.__members__.values():
        raise WireError("value", "frame.codec", ", ".join(f"{int(c)} {c.name}" for c in Codec))
    key, by_arrival, data = bool(flags & KEY_FLAG), bool(flags & 8), payload[FRAME.size :]
    return _picture(Picture(Codec(codec), key, width, height, angle, data, shrunk, by_arrival))


def _picture(picture: Picture) -> Picture:
    """The picture, if it keeps the laws.

    Raises:
        WireError: which one it breaks.
    """
    if not picture.data:
        raise WireError("size", "frame", f"more than {FRAME.size} bytes of payload")
    size = picture.width, picture.height
    if min(size) < 16 or picture.width * picture.height > MAX_PIXELS:
        raise WireError("value", "frame.size", f"16×16 up to {MAX_PIXELS} pixels")
    if not 0 <= picture.shrunk <= MOST_SHRUNK:
        raise WireError("value", "frame.shrunk", f"0 to {MOST_SHRUNK}")
    if picture.codec == Codec.JPEG and picture.data[:2] != b"\xff\xd8":
        raise WireError("value", "frame.data", "a JPEG, beginning with FF D8")
    _angle(picture.screen_angle_deg, "frame.screen_angle_deg")
    return picture


def _touch(payload: bytes, _flags: int) -> Touch:
    held, visible, _, press, nonce = _unpack(TOUCH, payload, "touch")
    if held not in (0, 1) or visible not in (0, 1):
        raise WireError("value", "touch.held, touch.visible", "0 or 1")
    return Touch(bool(held), bool(visible), int(press), int(nonce))


def _pong(payload: bytes, _flags: int) -> Pong:
    nonce, server_time_us = _unpack(PONG, payload, "pong")
    return Pong(int(nonce), int(server_time_us))


def _stamp(payload: bytes, _flags: int) -> Stamp:
    return Stamp(int(_unpack(STAMP, payload, "stamp")[0]))


def _ping(payload: bytes, _flags: int) -> Ping:
    return Ping(int(_unpack(PING, payload, "ping")[0]))


def _credit(payload: bytes, _flags: int) -> Credit:
    return Credit(int(_unpack(CREDIT, payload, "credit")[0]))


def _thumbnail(payload: bytes, _flags: int) -> Thumbnail:
    return Thumbnail(payload)


_DECODERS: dict[int, Callable[[bytes, int], Body]] = {
    Kind.MOTION: _motion,
    Kind.FRAME: _frame,
    Kind.TOUCH: _touch,
    Kind.PONG: _pong,
    Kind.STAMP: _stamp,
    Kind.PING: _ping,
    Kind.CREDIT: _credit,
    Kind.PICTURE: _thumbnail,
}
