"""A picture's record rides at its end, through any packets, and leaves the picture as it was."""

from binascii import crc_hqx
from fractions import Fraction

import av
import numpy as np
import pytest
from aiortc.codecs import depayload, get_capabilities, get_encoder
from aiortc.rtcrtpparameters import RTCRtpCodecParameters
from hypothesis import given
from hypothesis import strategies as st

from hardware.codec import Decoder, Encoder
from server.protocol.wire import WireError
from server.rtc.receiving.metadata_trailer import (
    FIELDS,
    HAS_ORIENTATION,
    MARK,
    TRAILER_BYTES,
    FrameRecord,
    _escaped,
    append,
    split,
)

HALF = (0.5, -0.5, 0.5, -0.5)
RECORD = FrameRecord(7, 123_456_789, 90, HALF)
records = st.builds(
    FrameRecord,
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**60 - 1),
    st.sampled_from([0, 90, 180, 270]),
    st.sampled_from([None, HALF, (1.0, 0.0, 0.0, 0.0), (0.0, 0.6, 0.0, -0.8)]),
    st.integers(0, 2),
)


@given(st.binary(min_size=1, max_size=200), records)
def test_what_was_appended_is_taken_off_again(data, record):
    whole = append(data, record)
    assert len(whole) == len(data) + TRAILER_BYTES
    assert min(whole[-TRAILER_BYTES:]) >= 0x80  # no zero, so no start code and no emulation of one
    plain, said = split(whole)
    assert plain == data
    assert (said.sequence, said.t_us, said.screen_angle_deg, said.shrunk) == (
        record.sequence, record.t_us, record.screen_angle_deg, record.shrunk,
    )  # fmt: skip
    if record.orientation_wxyz is None:
        assert said.orientation_wxyz is None
    else:
        assert said.orientation_wxyz == pytest.approx(record.orientation_wxyz, abs=5e-5)


def with_orientation(length, direction):
    """A picture whose record holds a quaternion of such a length, as no page of ours sends it."""
    numbers = [round(32767 * length * q) for q in direction]
    raw = FIELDS.pack(1, 2, HAS_ORIENTATION, *numbers)
    return b"picture" + _escaped(raw + crc_hqx(raw, 0).to_bytes(2, "little")) + MARK


@given(st.floats(0.955, 1.0), st.sampled_from([HALF, (1.0, 0.0, 0.0, 0.0), (0.0, 0.6, 0.0, -0.8)]))
def test_a_quaternion_of_nearly_unit_length_is_made_one(length, direction):
    _, said = split(with_orientation(length, direction))
    assert np.linalg.norm(said.orientation_wxyz) == pytest.approx(1.0, abs=1e-12)
    assert said.orientation_wxyz == pytest.approx(direction, abs=1e-4)


@pytest.mark.parametrize("length", [0.0, 0.5, 0.94, 1.06, 1.4])
def test_a_quaternion_of_another_length_is_refused(length):
    with pytest.raises(WireError, match=r"trailer\.orientation"):
        split(with_orientation(length, HALF))


@given(st.binary(max_size=200))
def test_a_picture_without_a_record_stays_as_it_is(data):
    assert split(data) == (data, None)
    assert split(data + MARK) == (data + MARK, None)


def test_a_damaged_record_is_none():
    whole = bytearray(append(b"picture", RECORD))
    whole[-10] ^= 0x04
    assert split(bytes(whole)) == (bytes(whole), None)


@pytest.mark.parametrize(
    ("change", "field"),
    [((8, b"\xff" * 4), "time"), ((12, b"\x18"), "flags"), ((13, bytes(8)), "orientation")],
)
def test_values_that_cannot_be_are_refused(change, field):
    fields = bytearray(FIELDS.pack(1, 2, HAS_ORIENTATION, 32767, 0, 0, 0))
    at, new = change
    fields[at : at + len(new)] = new
    raw = bytes(fields) + crc_hqx(bytes(fields), 0).to_bytes(2, "little")
    with pytest.raises(WireError, match=rf"trailer\.{field}"):
        split(b"picture" + _escaped(raw) + MARK)


@pytest.mark.parametrize(("name", "mime"), [("h264", "video/H264"), ("vp8", "video/VP8")])
def test_it_survives_the_packets_and_the_picture_is_the_same(name, mime):
    capability = next(c for c in get_capabilities("video").codecs if c.mimeType == mime)
    codec = RTCRtpCodecParameters(mime, 90_000, parameters=capability.parameters)
    encoder, packer = Encoder(320, 240, 30.0, 1_000_000, name), get_encoder(codec)
    rng = np.random.default_rng(1)
    with_record, without = Decoder(name, 320, 240), Decoder(name, 320, 240)
    for k in range(8):
        data, _ = encoder.encode(rng.integers(0, 255, (240, 320), dtype=np.uint8))
        packet = av.Packet(append(data, FrameRecord(k, k, 0, HALF)))
        packet.pts, packet.time_base = k, Fraction(1)
        payloads, _ = packer.pack(packet)
        plain, said = split(b"".join(depayload(codec, payload) for payload in payloads))
        assert said.sequence == k
        np.testing.assert_array_equal(with_record.decode(plain), without.decode(data))
