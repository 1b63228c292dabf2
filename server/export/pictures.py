"""Pictures of a stream in colour, and as JPEG, for formats that don't take them as they came."""

from __future__ import annotations

import cv2
import numpy as np

from hardware.codec import DecodeError, Decoder
from pipeline.signals import Image
from server.export.decoded import DatedPicture
from server.phone.decoder import CODEC_NAMES
from server.protocol.wire_records import Codec, Picture

QUALITY = 90
"""Of a JPEG, in percent."""


class ColourDecoder:
    """Decodes one stream in colour, from one key picture to the next loss."""

    def __init__(self) -> None:
        """Wait for a key picture."""
        self._decoder: Decoder | None = None
        self._next = -1

    def decoded(self, dated: DatedPicture) -> Image | None:
        """(height, width, 3) BGR; None if it can't be decoded."""
        picture = dated.picture
        follows = dated.sequence == self._next
        self._next = (dated.sequence + 1) & 0xFFFFFFFF
        if picture.key and not (follows and self._fits(picture)):
            self._decoder = Decoder(CODEC_NAMES[picture.codec], picture.width, picture.height)
        elif not (follows and self._fits(picture)):
            self._decoder = None
        if self._decoder is None:
            return None
        try:
            return self._decoder.decode_colour(picture.data)
        except DecodeError:
            self._decoder = None
            return None

    def _fits(self, picture: Picture) -> bool:
        decoder = self._decoder
        if decoder is None:
            return False
        wanted = CODEC_NAMES[picture.codec], picture.width, picture.height
        return (decoder.codec, decoder.width, decoder.height) == wanted


class JpegMaker:
    """JPEG files of a stream: as they came, or made of what was decoded."""

    def __init__(self) -> None:
        """Begin with a stream."""
        self._colour = ColourDecoder()

    def jpeg(self, dated: DatedPicture) -> bytes | None:
        """A JPEG file; None if the picture can't be decoded."""
        if dated.picture.codec == Codec.JPEG:
            return dated.picture.data
        image = self._colour.decoded(dated)
        if image is None:
            return None
        _, data = cv2.imencode(
            ".jpg", np.ascontiguousarray(image), (cv2.IMWRITE_JPEG_QUALITY, QUALITY)
        )
        return data.tobytes()
