"""Ways that a picture takes from the phone to the server."""

from __future__ import annotations

import re
from dataclasses import dataclass

from hardware.codec import DecodeError, Decoder, Encoder
from hardware.sim.scenes.scene import Size
from hardware.sim.scenes.video import RATE_HZ
from pipeline.signals import Frame, Image

DEFAULT_CODECS = ("raw", "h264-0.5", "h264-1", "h264-2", "h264-4", "vp8-2")
NAMED = re.compile(r"(h264|vp8)-(\d+(?:\.\d+)?)")
WITHOUT_IMU = "-noimu"


@dataclass(frozen=True, slots=True)
class Channel:
    """A codec at a bitrate, with or without the motion sensors beside it."""

    codec: str
    """raw, jpeg, or a video codec and its Mbit/s, as in h264-0.5."""
    imu: bool = True

    @property
    def name(self) -> str:
        """Name as in tables."""
        return self.codec if self.imu else self.codec + WITHOUT_IMU


def channel(name: str) -> Channel:
    """The channel called so: a codec, and "-noimu" behind it for one without motion sensors.

    Raises:
        ValueError: no such codec; says what is allowed.
    """
    codec = name.removesuffix(WITHOUT_IMU)
    if codec not in ("raw", "jpeg") and not NAMED.fullmatch(codec):
        raise ValueError(f"codec {codec!r}: allowed: raw, jpeg, h264-MBIT, vp8-MBIT (as h264-0.5)")
    return Channel(codec, codec == name)


class Wire:
    """One stream through a channel."""

    def __init__(self, codec: str, size: Size) -> None:
        """Begin a stream."""
        self._coder: tuple[Encoder, Decoder] | None = None
        if codec != "raw":
            named = NAMED.fullmatch(codec)
            kind, rate = (named[1], float(named[2])) if named else (codec, 1.0)
            encoder = Encoder(*size, RATE_HZ, round(1e6 * rate), kind)
            self._coder = encoder, Decoder(kind, *size)

    def carry(self, t: float, luma: Image) -> Frame | None:
        """The picture as it arrives; None: not decodable."""
        if self._coder is None:
            return Frame(t, luma)
        encoder, decoder = self._coder
        try:
            return Frame(t, decoder.decode(encoder.encode(luma)[0]), decoder.full_range)
        except DecodeError:
            return None
