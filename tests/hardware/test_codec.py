"""Bytes of pictures: what comes back is what went in, at once; everything else is refused."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.codec import CODECS, DecodeError, Decoder, Encoder, jpeg_size

W, H = 320, 240
VIDEO = ("h264", "vp8")


def picture(k=0, width=W, height=H):
    """A dim room with three blurred lights that drift by 1.3 px from picture to picture."""
    v, u = np.mgrid[:height, :width]
    light = 30.0 + 8.0 * v / height
    for cu, cv in ((80.3, 60.7), (200.6, 100.2), (130.5, 190.4)):
        light = light + 220.0 * np.exp(-((u - cu - 1.3 * k) ** 2 + (v - cv) ** 2) / 8.0)
    return np.clip(np.round(light), 0, 255).astype(np.uint8)


def centroid(luma, u, v, half=9):
    """Intensity-weighted, above the local background."""
    u0, v0 = round(u), round(v)
    window = luma[v0 - half : v0 + half + 1, u0 - half : u0 + half + 1].astype(float)
    weight = np.maximum(0.0, window - np.median(window) - 0.2 * np.ptp(window))
    rows, columns = np.mgrid[v0 - half : v0 + half + 1, u0 - half : u0 + half + 1]
    return np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()


def stream(codec, count, **keys):
    encoder = Encoder(W, H, 30.0, 2_000_000, codec)
    return [encoder.encode(picture(k), **keys) for k in range(count)]


def decoded_or_why(decoder, data):
    try:
        return decoder.decode(data)
    except DecodeError as error:
        return str(error)


@pytest.mark.parametrize("codec", CODECS)
def test_every_picture_comes_back_at_once_in_its_place(codec):
    decoder = Decoder(codec, W, H)
    for k, (data, _) in enumerate(stream(codec, 8)):
        luma = decoder.decode(data)
        for u, v in ((80.3, 60.7), (200.6, 100.2), (130.5, 190.4)):
            off = centroid(luma, u + 1.3 * k, v) - centroid(picture(k), u + 1.3 * k, v)
            assert np.abs(off).max() <= 0.1


@pytest.mark.parametrize("codec", CODECS)
def test_luma_spans_the_range_that_the_decoder_says(codec):
    decoder = Decoder(codec, W, H)
    black, white = np.zeros((H, W), np.uint8), np.full((H, W), 255, np.uint8)
    encoder = Encoder(W, H, 30.0, 2_000_000, codec)
    seen = [int(np.median(decoder.decode(encoder.encode(x, key=True)[0]))) for x in (black, white)]
    assert seen == ([0, 255] if decoder.full_range else [16, 235])


@pytest.mark.parametrize("codec", VIDEO)
def test_a_key_frame_comes_when_asked_and_every_two_seconds(codec):
    encoder = Encoder(W // 4, H // 4, 10.0, 1_000_000, codec)
    small = picture()[::4, ::4].copy()
    keys = [k for k in range(45) if encoder.encode(small, key=k == 7)[1]]
    assert keys == [0, 7, 20, 40]


@pytest.mark.parametrize("codec", VIDEO)
def test_a_stream_is_joined_at_any_key_frame_and_nowhere_else(codec):
    encoder = Encoder(W, H, 30.0, 2_000_000, codec)
    data = [encoder.encode(picture(k), key=k == 3)[0] for k in range(6)]
    decoder, whole = Decoder(codec, W, H), Decoder(codec, W, H)
    expected = [whole.decode(part).copy() for part in data]
    for part in data[1:3]:
        assert isinstance(decoded_or_why(decoder, part), str)
    for part, luma in zip(data[3:], expected[3:], strict=True):
        np.testing.assert_array_equal(decoder.decode(part), luma)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.95])
def test_h264_that_lost_its_end_is_refused_and_so_is_what_builds_on_it(share):
    parts = [data for data, _ in stream("h264", 4)]
    decoder = Decoder("h264", W, H)
    decoder.decode(parts[0])
    cut = parts[1][: int(share * len(parts[1]))]
    assert "key frame" in decoded_or_why(decoder, cut)
    assert "key frame" in decoded_or_why(decoder, parts[2])
    again = Encoder(W, H, 30.0, 2_000_000).encode(picture(), key=True)[0]
    assert decoder.decode(again).shape == (H, W)


def test_of_h264_with_flipped_bits_next_to_nothing_is_shown():
    first, second = (data for data, _ in stream("h264", 2))
    rng, refused = np.random.default_rng(1), 0
    for _ in range(200):
        broken = bytearray(second)
        for at in rng.integers(6, len(broken), 3):
            broken[at] ^= int(rng.integers(1, 256))
        decoder = Decoder("h264", W, H)
        decoder.decode(first)
        shown = decoded_or_why(decoder, bytes(broken))
        refused += isinstance(shown, str)
    assert refused >= 190  # H.264 has no checksum: the links have


@pytest.mark.parametrize("codec", CODECS)
@settings(max_examples=25)
@given(data=st.binary(min_size=0, max_size=2000))
def test_garbage_is_refused_with_a_reason(codec, data):
    with pytest.raises(DecodeError, match=r"\w"):
        Decoder(codec, W, H).decode(data)


@pytest.mark.parametrize("codec", CODECS)
@settings(max_examples=25)
@given(data=st.binary(min_size=1, max_size=200))
def test_garbage_behind_an_honest_head_does_not_get_past(codec, data):
    decoder = Decoder(codec, W, H)
    head = HEADS[codec]
    shown = decoded_or_why(decoder, head + data)
    assert isinstance(shown, str) or shown.shape == (H, W)


HEADS = {codec: stream(codec, 1)[0][0][:60] for codec in CODECS}


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("size", [(640, 480), (160, 120), (240, 320), (1024, 512)])
def test_a_picture_of_another_size_is_refused(codec, size):
    data, _ = Encoder(*size, 30.0, 2_000_000, codec).encode(np.zeros(size[::-1], np.uint8))  # type: ignore[call-arg]
    with pytest.raises(DecodeError):
        Decoder(codec, W, H).decode(data)


def jpeg(*options):
    return cv2.imencode(".jpg", picture(), list(options))[1].tobytes()


def test_a_jpeg_that_claims_to_be_huge_is_refused_by_its_head():
    data = bytearray(jpeg())
    at = data.find(b"\xff\xc0")
    data[at + 5 : at + 9] = (30_000).to_bytes(2, "big") * 2
    assert jpeg_size(bytes(data)) == (30_000, 30_000)
    with pytest.raises(DecodeError, match="a JPEG of size"):  # before anything is decoded
        Decoder("jpeg", W, H).decode(bytes(data))


def test_a_jpeg_cut_short_is_refused():
    data = jpeg()
    for share in (0.1, 0.5, 0.99):
        with pytest.raises(DecodeError):
            Decoder("jpeg", W, H).decode(data[: int(share * len(data))])


def test_a_progressive_jpeg_is_read_and_one_of_thousands_of_scans_is_not():
    data = jpeg(cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    assert Decoder("jpeg", W, H).decode(data).shape == (H, W)
    first = data.find(b"\xff\xda")
    second = data.find(b"\xff\xda", first + 2)
    with pytest.raises(DecodeError, match="scans"):
        Decoder("jpeg", W, H).decode(data[:second] + data[first:second] * 1000 + b"\xff\xd9")


def test_a_jpeg_is_not_turned_whatever_it_says_of_its_orientation():
    data = jpeg(cv2.IMWRITE_JPEG_QUALITY, 95)
    exif = b"Exif\x00\x00MM\x00*\x00\x00\x00\x08\x00\x01\x01\x12\x00\x03\x00\x00\x00\x01\x00\x03"
    exif += b"\x00\x00\x00\x00\x00\x00"
    turned = data[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + data[2:]
    luma = Decoder("jpeg", W, H).decode(turned)
    assert np.abs(luma.astype(int) - picture().astype(int)).max() < 12


def test_an_unknown_codec_is_named_with_those_that_are_known():
    for build in (lambda: Encoder(W, H, 30.0, 1, "h266"), lambda: Decoder("h266", W, H)):
        with pytest.raises(ValueError, match=r"h266.*h264, vp8, jpeg"):
            build()


def test_rows_with_gaps_are_seen_as_a_picture_of_the_right_width():
    encoder, decoder = Encoder(200, 120, 30.0, 1_000_000), Decoder("h264", 200, 120)
    luma = np.tile(np.arange(200, dtype=np.uint8), (120, 1))
    seen = decoder.decode(encoder.encode(luma)[0])
    assert seen.shape == (120, 200)
    assert np.corrcoef(seen.ravel().astype(float), luma.ravel().astype(float))[0, 1] > 0.999
