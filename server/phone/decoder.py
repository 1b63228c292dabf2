"""Encoded pictures of one stream and size to luma, whatever was lost on the way."""

from __future__ import annotations

from hardware.codec import DecodeError, Decoder
from pipeline.signals import Image
from server.media.decoding import AnyDecoder, MakeDecoder
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Codec

CODEC_NAMES = {Codec.JPEG: "jpeg", Codec.H264: "h264", Codec.VP8: "vp8"}


class FrameDecoder:
    """Decodes what can be decoded, and knows when only a key frame helps."""

    def __init__(self, width: int, height: int, make: MakeDecoder = Decoder) -> None:
        """Decode pictures of one size [px]; `make` says where they are decoded, by itself here."""
        self._size = width, height
        self._make = make
        self._decoder: AnyDecoder | None = None
        self.luma: Image | None = None
        """The newest decoded picture; valid until the next."""
        self.undecodable = 0
        self._next = -1
        """Sequence number that follows without a gap."""
        self.needs_key = True
        """The stream can't be decoded before a key frame."""

    @property
    def full_range(self) -> bool:
        """Whether luma reaches from 0 to 255."""
        return self._decoder is None or self._decoder.full_range

    def decoded(self, frame: EncodedFrame) -> Image | None:
        """Luma (height, width) of the next picture; None if it can't be decoded."""
        picture = frame.picture
        name = CODEC_NAMES[picture.codec]
        if self._decoder is None or self._decoder.codec != name:
            self._decoder = self._make(name, *self._size)
            self.needs_key = True
        if frame.sequence != self._next:
            self.needs_key = (
                True  # a decoder hides a lost picture: LEDs would stand where they were
            )
        self._next = (frame.sequence + 1) & 0xFFFFFFFF
        if self.needs_key and not picture.key:
            return None
        try:
            self.luma = self._decoder.decode(picture.data)
        except DecodeError:
            self.undecodable += 1
            self.needs_key = True
            self._decoder = None
            return None
        self.needs_key = False
        return self.luma
