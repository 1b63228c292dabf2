"""Wire: what is written is read, and nothing else is."""

from __future__ import annotations

import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.protocol import wire, wire_records
from server.protocol.wire import WireError
from server.protocol.wire_records import Codec, Record

MOTION = wire_records.Motion((0.1, 0.2, 0.3), (0.0, 0.0, 9.8), (1.0, 0.0, 0.0, 0.0), 90)
PICTURE = wire_records.Picture(Codec.H264, True, 1280, 720, 90, b"\x00\x00\x00\x01x")
BODIES = [
    replace(MOTION, rotation_rate=(0.5, 0.25, -2.0), acceleration=(0.0, 1.0, 9.75)),
    replace(MOTION, orientation_wxyz=None, rotation_rate=(0.5,) * 3, acceleration=(0.5,) * 3),
    PICTURE,
    replace(PICTURE, by_arrival=True),
    replace(PICTURE, shrunk=2),
    wire_records.Touch(True, True, 3, 2**64 - 1),
    wire_records.Stamp(2**32 - 1),
    wire_records.Pong(7, 2**40),
    wire_records.Ping(2**63),
    wire_records.Credit(2**32 - 1),
    wire_records.Thumbnail(b"\xff\xd8jpeg"),
]


@pytest.mark.parametrize("body", BODIES, ids=lambda b: type(b).__name__)
def test_what_is_encoded_is_decoded(body: wire_records.Body) -> None:
    record = Record(2**32 - 1, 1_234_567_890_123, body)
    assert wire.decode(wire.encode(record)) == record


def refusal_of(data: bytes) -> WireError | None:
    """What is wrong with a record; anything but WireError would be a fault of the decoder."""
    try:
        wire.decode(data)
    except WireError as error:
        return error
    return None


@given(st.binary(max_size=200))
def test_any_bytes_give_a_record_or_a_named_error(data: bytes) -> None:
    refusal = refusal_of(data)
    assert refusal is None or (refusal.field and refusal.allowed)


@given(st.sampled_from(BODIES), st.integers(0, 60), st.integers(0, 255))
def test_a_flipped_byte_gives_a_record_or_a_named_error(
    body: wire_records.Body, at: int, value: int
) -> None:
    data = bytearray(wire.encode(Record(1, 2, body)))
    data[at % len(data)] = value
    refusal = refusal_of(bytes(data))
    assert refusal is None or refusal.code in ("type", "size", "version", "value")


NAN, INF = float("nan"), float("inf")
BAD = [
    ("motion.rotation_rate", replace(MOTION, rotation_rate=(NAN, 0.0, 0.0))),
    ("motion.acceleration", replace(MOTION, acceleration=(0.0, INF, 0.0))),
    ("motion.acceleration", replace(MOTION, acceleration=(0.0, 1e4, 0.0))),
    ("motion.orientation_wxyz", replace(MOTION, orientation_wxyz=(0.1, 0.0, 0.0, 0.0))),
    ("motion.screen_angle_deg", replace(MOTION, screen_angle_deg=45)),
    ("frame.size", replace(PICTURE, width=30_000, height=30_000)),
    ("frame.size", replace(PICTURE, width=0)),
    ("frame.shrunk", replace(PICTURE, shrunk=3)),
    ("frame.data", replace(PICTURE, codec=Codec.JPEG)),
    ("frame", replace(PICTURE, data=b"")),
]


@pytest.mark.parametrize(("field", "body"), BAD)
def test_bad_values_are_refused_by_name(field: str, body: wire_records.Body) -> None:
    with pytest.raises(WireError) as refusal:
        wire.decode(wire.encode(Record(1, 2, body)))
    assert refusal.value.field == field


def test_another_version_is_told_to_reload() -> None:
    data = bytearray(wire.encode(Record(1, 2, MOTION)))
    data[1] = wire.VERSION + 1
    with pytest.raises(WireError, match="reload") as refusal:
        wire.decode(bytes(data))
    assert refusal.value.code == "version"


def test_sizes_are_bounded() -> None:
    with pytest.raises(WireError, match="bytes"):
        wire.decode(b"")
    with pytest.raises(WireError, match="bytes"):
        wire.decode(bytes(wire.MAX_RECORD_BYTES + 1))
    head = struct.pack("<BBBBIq", wire.MAGIC, wire.VERSION, wire.Kind.TOUCH, 0, 1, 2)
    with pytest.raises(WireError, match="touch"):
        wire.decode(head + b"1234")
