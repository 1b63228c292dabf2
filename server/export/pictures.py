"""Pictures of a stream in colour, and as JPEG, for formats that don't take them as they came."""

from __future__ import annotations

import cv2
import numpy as np

from hardware.codec import DecodeError, Decoder
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.signals import Image
from server.export.decoded import DatedPicture
from server.phone.decoder import CODEC_NAMES
from server.protocol.wire_records import Codec, Picture

QUALITY = 90
"""Of a JPEG, in percent."""


FULL_COEFFICIENTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}
"""How many a lens model has where none may be left out."""


def coefficients(camera: Camera) -> Array:
    """Distortion of a lens, those left out as 0."""
    missing = FULL_COEFFICIENTS[camera.model] - len(camera.distortion)
    return np.pad(camera.distortion, (0, missing))


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


class PicturePacker:
    """Pictures for formats that know H.264 and JPEG, but no VP8: as they came, where possible."""

    def __init__(self) -> None:
        """Begin with a stream."""
        self._colour = ColourDecoder()
        self._has_key = False
        self._counts = {"h264": 0, "jpeg": 0}
        self._left_out = 0

    def packed(self, dated: DatedPicture) -> tuple[str, bytes] | None:
        """h264 or jpeg, and the bytes; None if the picture can't be decoded by itself or by us."""
        packed = self._packed(dated)
        if packed is None:
            self._left_out += 1
        else:
            self._counts[packed[0]] += 1
        return packed

    def summary(self) -> str:
        """How many there were."""
        video, jpeg = self._counts.values()
        return f"{video} pictures as video, {jpeg} as JPEG, {self._left_out} left out"

    def _packed(self, dated: DatedPicture) -> tuple[str, bytes] | None:
        picture = dated.picture
        if picture.codec == Codec.JPEG:
            return "jpeg", picture.data
        if picture.codec == Codec.H264:
            self._has_key = self._has_key or picture.key
            return ("h264", picture.data) if self._has_key else None
        image = self._colour.decoded(dated)
        if image is None:
            return None
        quality = (cv2.IMWRITE_JPEG_QUALITY, QUALITY)
        return "jpeg", cv2.imencode(".jpg", np.ascontiguousarray(image), quality)[1].tobytes()
