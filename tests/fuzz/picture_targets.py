"""Encoded pictures, whole streams of them, as the server decodes them."""

from hardware.codec import MAX_SCANS, DecodeError, Decoder, jpeg_size
from server.phone.decoder import FrameDecoder
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Codec, Picture
from tests.fuzz.pictures import HEIGHT, WIDTH, encoded
from tests.fuzz.sequence import pieces, together
from tests.fuzz.target import target

SHAPE = (HEIGHT, WIDTH)


def jpeg_seeds():
    (jpeg, _) = encoded("jpeg", 1)[0]
    yield jpeg
    yield jpeg[:2] + b"\xff\xe0\0\4hi" + jpeg[2:]
    yield jpeg_of(8000, 8000, jpeg)
    yield jpeg[:-2] + jpeg[jpeg.index(b"\xff\xda") :] * 3


def jpeg_of(width: int, height: int, jpeg: bytes) -> bytes:
    """The same file that says another size."""
    at = jpeg.index(b"\xff\xc0") + 5
    return jpeg[:at] + height.to_bytes(2, "big") + width.to_bytes(2, "big") + jpeg[at + 4 :]


@target("jpeg", jpeg_seeds, (DecodeError,), max_bytes=2048)
def jpeg(data: bytes) -> None:
    """Decoded is only what says the right size in its header and has it."""
    size = jpeg_size(data)
    assert size is None or all(0 <= side < 1 << 16 for side in size)
    luma = Decoder("jpeg", WIDTH, HEIGHT).decode(data)
    assert size == (WIDTH, HEIGHT)
    assert luma.shape == SHAPE
    assert data.count(b"\xff\xda") <= MAX_SCANS


def stream_of(codec: Codec):
    def seeds():
        small = encoded(codec.name.lower(), 4)
        other = encoded(codec.name.lower(), 2, width=128, height=96)
        yield together([bytes([key]) + data for data, key in small])
        yield together([bytes([key]) + data for data, key in small[1:] + small])
        yield together([bytes([key]) + data for data, key in small[:2] + other + small[:1]])

    def run(data: bytes) -> int:
        decoder, calls = FrameDecoder(WIDTH, HEIGHT), 0
        for k, piece in enumerate(pieces(data)):
            key, lost = bool(piece[:1] == b"\1"), k * (piece[:1] == b"\7")
            picture = Picture(codec, key, WIDTH, HEIGHT, 0, piece[1:])
            needed_key, undecodable = decoder.needs_key or bool(lost), decoder.undecodable
            luma = decoder.decoded(EncodedFrame(0.0, 0.0, k + lost, picture))
            calls += luma is not None or decoder.undecodable > undecodable
            if luma is None:
                assert decoder.needs_key
                assert decoder.undecodable <= undecodable + 1
            else:
                assert luma.shape == SHAPE
                assert key or not needed_key, "decoded without its key"
        return calls

    target(codec.name.lower(), seeds, max_bytes=8192, mutants=400)(run)


stream_of(Codec.H264)
stream_of(Codec.VP8)
