"""What the bytes of an encoded picture say of it, undecoded: is it a key, what is its size."""

from __future__ import annotations

from collections.abc import Iterator

from server.protocol.wire_records import Codec

START_CODE = b"\0\0\1"
DELIMITER, PARAMETERS = 9, 7
"""Kinds of H.264 unit that a key picture begins with; sequence parameters tell its size."""
UNITS_LOOKED_AT = 4
MAX_PARAMETERS_BYTES = 256
LARGEST_SIDE = 65_535
"""[px]; sequence parameters can say any number, also less than nothing."""
HIGH_PROFILES = (100, 110, 122, 244, 44, 83, 86, 118, 128)  # H.264, 7.3.2.1.1
VP8_KEY = b"\x9d\x01\x2a"
"""Bytes 3 to 5 of a VP8 key frame; its width and height follow."""


def begins_key(codec: Codec, data: bytes) -> bool:
    """Whether a picture that begins so can be decoded alone."""
    if codec is Codec.VP8:
        return len(data) >= 10 and not data[0] & 1 and data[3:6] == VP8_KEY
    return _parameters(data) is not None


def size_of_key(codec: Codec, data: bytes) -> tuple[int, int] | None:
    """Size (width, height) [px] of a key picture; None if it doesn't tell."""
    if not begins_key(codec, data):
        return None
    if codec is Codec.VP8:
        width, height = data[6] | data[7] << 8, data[8] | data[9] << 8
        return width & 0x3FFF, height & 0x3FFF
    parameters = _parameters(data)
    try:
        return _size(_Bits(_unescaped(parameters[:MAX_PARAMETERS_BYTES]))) if parameters else None
    except ValueError:
        return None


def _parameters(data: bytes) -> bytes | None:
    """The sequence parameters (Annex B) at the beginning of a picture, behind their header."""
    for unit in _units(data):
        kind = unit[0] & 0x1F if unit else 0
        if kind == PARAMETERS:
            return unit[1:]
        if kind != DELIMITER:
            return None
    return None


def _units(data: bytes) -> Iterator[bytes]:
    """The first few units between start codes."""
    start = data.find(START_CODE, 0, 4)
    for _ in range(UNITS_LOOKED_AT):
        if start < 0:
            return
        end = data.find(START_CODE, start + 3)
        yield data[start + 3 : end if end >= 0 else len(data)]
        start = end


def _unescaped(data: bytes) -> bytes:
    """Strip the bytes that only keep start codes from appearing."""
    return data.replace(b"\0\0\3", b"\0\0")


class _Bits:
    """Reads bits and Exp-Golomb numbers."""

    def __init__(self, data: bytes) -> None:
        self._value, self._left = int.from_bytes(data), 8 * len(data)

    def read(self, count: int) -> int:
        """The next bits as a number; ValueError behind the end."""
        if count > self._left:
            raise ValueError("sequence parameters end too early")
        self._left -= count
        return self._value >> self._left & (1 << count) - 1

    def number(self) -> int:
        """The next Exp-Golomb number, without sign."""
        zeros = 0
        while not self.read(1):
            zeros += 1
            if zeros > 31:
                raise ValueError("a number of more than 32 bits")
        return (1 << zeros) - 1 + self.read(zeros)

    def numbers(self, count: int) -> list[int]:
        """Several of them."""
        return [self.number() for _ in range(count)]


def _size(bits: _Bits) -> tuple[int, int]:
    """Size (width, height) in sequence parameters of 4:2:0 pictures (H.264, 7.3.2.1.1)."""
    profile = bits.read(8)
    bits.read(16)  # constraints, level
    bits.number()  # identifier
    if profile in HIGH_PROFILES:
        _skip_high(bits)
    bits.number()  # bits of the picture's number
    _skip_order(bits)
    bits.number()  # reference pictures
    bits.read(1)
    across, up = (count + 1 for count in bits.numbers(2))
    fields = 2 - bits.read(1)  # 2 where a picture may be two half pictures
    if fields == 2:
        bits.read(1)
    bits.read(1)
    left, right, top, bottom = bits.numbers(4) if bits.read(1) else (0, 0, 0, 0)
    width = 16 * across - 2 * (left + right)
    height = fields * (16 * up - 2 * (top + bottom))
    if not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE):
        raise ValueError("no size of a picture")
    return width, height


def _skip_high(bits: _Bits) -> None:
    if bits.number() != 1:
        raise ValueError("not 4:2:0")
    bits.numbers(2)  # bits of a sample
    bits.read(1)
    if bits.read(1):
        raise ValueError("a scaling matrix")


def _skip_order(bits: _Bits) -> None:
    """How pictures are put in order."""
    kind = bits.number()
    if kind == 0:
        bits.number()
    elif kind == 1:
        bits.read(1)
        bits.numbers(2)
        bits.numbers(min(bits.number(), 255))
