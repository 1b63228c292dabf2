"""A film as the pictures a page would have sent: as they are if possible, else encoded anew."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import av.error
import cv2
import numpy as np
from av.bitstream import BitStreamFilterContext
from av.video.reformatter import ColorRange

from hardware.codec import BLACK, WHITE, DecodeError, Decoder, Encoder
from pipeline.signals import Image
from server.common.errors import InputError
from server.media.frame import MediaFrame
from server.media.frame_source import open_frames
from server.protocol.wire import MAX_PIXELS, MAX_RECORD_BYTES, size_of
from server.protocol.wire_records import Codec, Picture

Taken = tuple[float, Picture]
"""When it was taken [s of the film], and what came of it."""
BITS_PER_PIXEL = 0.5
"""Of a picture encoded anew: LEDs and a board's corners stay where they are to 0.01 px or so."""
USUAL_FPS = 30.0  # for the encoder's bit rate alone


def pictures_of(film: Path, fps: float | None, screen_angle_deg: int) -> tuple[list[Taken], str]:
    """Pictures in the order of time, and a word about how they came.

    Raises:
        InputError: it can't be read, or its pictures are too large for a recording.
    """
    if fps is None and film.is_file():
        taken = _as_they_are(film, screen_angle_deg)
        if taken is not None:
            return taken, "H.264 as filmed"
    made = list(_encoded(film, fps, screen_angle_deg))
    if not made:
        raise InputError(film, "", "no picture of it can be read")
    return made, "encoded anew, in grey"


def _as_they_are(film: Path, screen_angle_deg: int) -> list[Taken] | None:
    """None unless each packet of the film is a picture that our decoder takes, in order."""
    taken: list[Taken] = []
    try:
        with av.open(str(film)) as container:
            if not container.streams.video:
                return None
            stream = container.streams.video[0]
            context, base = stream.codec_context, stream.time_base
            is_full = context.color_range == ColorRange.JPEG or context.pix_fmt == "yuvj420p"
            if context.name != "h264" or is_full or base is None:
                return None
            width, height = context.width, context.height
            annex_b = BitStreamFilterContext("h264_mp4toannexb", stream)
            decoder = Decoder("h264", width, height)
            for packet in container.demux(stream):
                is_key = packet.is_keyframe
                for part in annex_b.filter(packet if packet.size else None):
                    data = bytes(part)
                    picture = Picture(Codec.H264, is_key, width, height, screen_angle_deg, data)
                    t = float((part.pts or 0) * base)
                    if not _fits(picture) or (taken and t <= taken[-1][0]):
                        return None
                    decoder.decode(data)
                    taken.append((t, picture))
    except (av.error.FFmpegError, DecodeError, OSError):
        return None
    return taken or None


def _encoded(film: Path, fps: float | None, screen_angle_deg: int) -> Iterator[Taken]:
    encoder: Encoder | None = None
    for shot in open_frames(film, fps):
        if shot.luma is None:
            continue
        height, width = shot.luma.shape
        if encoder is None:
            rate = fps or USUAL_FPS
            encoder = Encoder(width, height, rate, round(BITS_PER_PIXEL * width * height * rate))
        if (encoder.width, encoder.height) != (width, height):
            raise InputError(film, shot.name, "pictures of one size")
        data, key = encoder.encode(_full(shot, shot.luma))
        picture = Picture(Codec.H264, key, width, height, screen_angle_deg, data)
        if not _fits(picture):
            allowed = f"at most {MAX_PIXELS} pixels and {MAX_RECORD_BYTES} bytes: film smaller"
            raise InputError(film, shot.name, allowed)
        yield shot.t, picture


def _fits(picture: Picture) -> bool:
    """Whether a record can hold it."""
    is_small = picture.width * picture.height <= MAX_PIXELS
    return is_small and len(picture.data) > 0 and size_of(picture) <= MAX_RECORD_BYTES


def _full(shot: MediaFrame, luma: Image) -> Image:
    """Grey levels from 0 to 255, whatever they were."""
    if shot.full_range:
        return luma
    levels = (np.arange(256) - BLACK) * (255.0 / (WHITE - BLACK))
    return np.asarray(cv2.LUT(luma, np.clip(np.round(levels), 0, 255).astype(np.uint8)), np.uint8)
