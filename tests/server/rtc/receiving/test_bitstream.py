"""What a picture's bytes say of it, by real encoders; and nonsense says nothing."""

from fractions import Fraction

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.codec import Encoder
from server.protocol.wire_records import Codec
from server.rtc.receiving.bitstream import begins_key, size_of_key

SIZES = [(1280, 720), (640, 360), (854, 480), (320, 240), (1920, 1080)]
CODECS = [("h264", Codec.H264), ("vp8", Codec.VP8)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("name", "codec"), CODECS)
def test_a_key_tells_its_size_and_others_are_no_keys(name, codec, size):
    width, height = size
    encoder = Encoder(width, height, 30.0, 2_000_000, name)
    picture = np.zeros((height, width), np.uint8)
    first, second = (encoder.encode(picture)[0] for _ in range(2))
    assert begins_key(codec, first)
    assert size_of_key(codec, first) == size
    assert not begins_key(codec, second)
    assert size_of_key(codec, second) is None


@pytest.mark.parametrize("profile", ["baseline", "main", "high"])
def test_every_profile_of_a_phone_tells_its_size(profile):
    context = av.CodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = 1280, 720, "yuv420p"
    context.time_base = Fraction(1, 30)
    context.options = {"profile": profile, "tune": "zerolatency", "preset": "ultrafast", "aud": "1"}
    frame = av.VideoFrame(1280, 720, "yuv420p")
    frame.pts = 0
    data = b"".join(bytes(packet) for packet in context.encode(frame))
    assert size_of_key(Codec.H264, data) == (1280, 720)


@given(st.binary(max_size=80), st.sampled_from([b"", b"\0\0\1\x67", b"\0\0\0\1\x67\x64\0\x1f"]))
def test_nonsense_never_raises(data, beginning):
    for _, codec in CODECS:
        begins_key(codec, beginning + data)
        size_of_key(codec, beginning + data)


def test_a_picture_that_begins_with_its_slice_is_no_key():
    assert not begins_key(Codec.H264, b"\0\0\0\1\x65" + bytes(20))
    assert not begins_key(Codec.H264, b"")
    assert not begins_key(Codec.VP8, b"\x10\0\0")
