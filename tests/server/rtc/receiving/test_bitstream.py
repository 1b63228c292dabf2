"""What a picture's bytes say of it, by real encoders; and nonsense says nothing."""

from fractions import Fraction
from typing import Any

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


ODD_SIZES = [(16, 16), (18, 34), (322, 242), (638, 478), (1278, 718)]
"""Their last blocks are cropped."""
X264 = [
    {"profile": "baseline", "preset": "veryfast"},
    {"profile": "main", "preset": "medium", "bf": "0"},
    {"profile": "high", "preset": "medium", "bf": "0", "refs": "4"},
    {"profile": "high", "preset": "slow", "bf": "0", "refs": "8", "aud": "1"},
    {"profile": "main", "preset": "veryfast", "level": "5.1"},
]
VPX = [
    {"deadline": "realtime", "cpu-used": "8"},
    {"deadline": "good", "cpu-used": "2", "lag-in-frames": "0"},
]


def coded(name, words, size, count=5, keys_every=2, pixels="yuv420p"):
    """(bytes, whether it is a key) of a stream by a real encoder, as libav says it."""
    context: Any = av.CodecContext.create(name, "w")
    context.width, context.height = size
    context.pix_fmt = pixels
    context.time_base, context.gop_size = Fraction(1, 30), keys_every
    context.options = dict(words)
    if name == "libx264":
        context.options |= {"tune": "zerolatency", "sc_threshold": "0"}
    packets = []
    for k in range(count):
        frame = av.VideoFrame(size[0], size[1], pixels)
        frame.pts = k
        for plane in frame.planes:
            plane.update(bytes([40 + 9 * k]) * plane.buffer_size)
        packets += context.encode(frame)
    packets += context.encode(None)
    assert len(packets) == count
    return [(bytes(packet), packet.is_keyframe) for packet in packets]


@pytest.mark.parametrize("size", ODD_SIZES, ids=str)
@pytest.mark.parametrize(
    ("name", "words"), [*(("libx264", w) for w in X264), *(("libvpx", w) for w in VPX)]
)
def test_of_real_streams_the_keys_and_they_alone_tell_the_size_that_was_coded(name, words, size):
    codec = Codec.H264 if name == "libx264" else Codec.VP8
    said = coded(name, words, size)
    assert sum(is_key for _, is_key in said) == 3
    for data, is_key in said:
        assert begins_key(codec, data) == is_key
        assert size_of_key(codec, data) == (size if is_key else None)


@pytest.mark.parametrize("pixels", ["yuv422p", "yuv444p"])
def test_a_stream_of_other_colours_is_a_key_that_tells_no_size(pixels):
    (data, is_key), *_ = coded("libx264", {"preset": "veryfast"}, (320, 240), 1, pixels=pixels)
    assert is_key
    assert begins_key(Codec.H264, data)
    assert size_of_key(Codec.H264, data) is None


@pytest.mark.parametrize("params", ["interlaced=1", "cqm=jvt"])
def test_half_pictures_and_scaling_matrices_do_not_hide_the_size(params):
    (data, _), *_ = coded("libx264", {"preset": "veryfast", "x264-params": params}, (320, 240), 1)
    assert size_of_key(Codec.H264, data) == (320, 240)


@given(st.binary(max_size=80), st.sampled_from([b"", b"\0\0\1\x67", b"\0\0\0\1\x67\x64\0\x1f"]))
def test_nonsense_never_raises(data, beginning):
    for _, codec in CODECS:
        begins_key(codec, beginning + data)
        size_of_key(codec, beginning + data)


def test_a_picture_that_begins_with_its_slice_is_no_key():
    assert not begins_key(Codec.H264, b"\0\0\0\1\x65" + bytes(20))
    assert not begins_key(Codec.H264, b"")
    assert not begins_key(Codec.VP8, b"\x10\0\0")
