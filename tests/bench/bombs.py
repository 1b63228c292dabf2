"""Pictures that are not what they say, of the size that was announced, so that they are decoded."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from fractions import Fraction
from typing import Final

import av
import cv2
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType

from hardware.codec import MAX_SCANS, SCAN
from server.protocol.wire import MAX_RECORD_BYTES
from server.protocol.wire_records import Codec

GREY: Final = 90
HUGE_PX: Final = 30_000
"""A side that a JPEG says; decoded it would take 900 MB."""
GROWN_PX: Final = (4_096, 2_304)
ROOM_BYTES: Final = 8_192
"""For what stands around a picture in its record."""
PARAMETERS: Final = b"\0\0\0\1\x67"
KEY: Final = b"\0\0\1\x65"
CHEAP_TO_SEND: Final = "cabac=1:qp=51:deblock=6,6:keyint=1:threads=1:repeat-headers=1"
"""A flat picture in 200 bytes, each of its edges smoothed: a thousand take a second to decode."""
FATAL: Final = "H.264 of a thousand in one"
"""Ends the decoder by its processor time; the others are refused."""


def bombs(width: int, height: int) -> Mapping[str, tuple[Codec, bytes]]:
    """By name, each for an announced picture of that size [px]."""
    small, big = _flat(width, height), _flat(*GROWN_PX)
    first, again = small[small.index(PARAMETERS) :], small[small.index(KEY) - 1 :]
    thousand = first + again * ((MAX_RECORD_BYTES - ROOM_BYTES - len(first)) // len(again))
    return {
        "a JPEG of 900 megapixels": (Codec.JPEG, _huge_jpeg()),
        "a JPEG of many scans": (Codec.JPEG, _scanned_jpeg(width, height)),
        "H.264 that grows": (Codec.H264, first + big[big.index(PARAMETERS) :]),
        "H.264 of zeros": (Codec.H264, first[: first.index(KEY) + len(KEY)] + bytes(40_000)),
        FATAL: (Codec.H264, thousand),
    }


def _flat(width: int, height: int) -> bytes:
    """A key picture of one grey."""
    context = av.CodecContext.create("libx264", "w")
    assert isinstance(context, VideoCodecContext)
    context.width, context.height, context.pix_fmt = width, height, "yuv420p"
    context.time_base, context.thread_count = Fraction(1, 30), 1
    context.options = {"tune": "zerolatency", "profile": "main", "x264-params": CHEAP_TO_SEND}
    frame = av.VideoFrame(width, height, "yuv420p")
    for plane in frame.planes:
        np.frombuffer(memoryview(plane), np.uint8)[:] = GREY
    frame.pts, frame.pict_type = 0, PictureType.I
    return b"".join(bytes(packet) for packet in context.encode(frame))


def _huge_jpeg() -> bytes:
    frame = struct.pack(">HBHHB", 17, 8, HUGE_PX, HUGE_PX, 3)
    return b"\xff\xd8\xff\xc0" + frame + b"\x01\x22\x00\x02\x11\x01\x03\x11\x01" + bytes(300)


def _scanned_jpeg(width: int, height: int) -> bytes:
    """The last scan of a progressive one more often than is taken."""
    luma = np.full((height, width), GREY, np.uint8)
    _, encoded = cv2.imencode(".jpg", luma, (cv2.IMWRITE_JPEG_PROGRESSIVE, 1))
    jpeg = encoded.tobytes()
    end = len(jpeg) - 2
    return jpeg[:end] + jpeg[jpeg.rindex(SCAN) : end] * MAX_SCANS + jpeg[end:]
