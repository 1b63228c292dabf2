"""Pictures to bytes and back: H.264, VP8, JPEG. Hostile bytes are refused."""

from __future__ import annotations

import os

os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "4200000")  # read when cv2 is loaded

from fractions import Fraction

import av
import av.error
import cv2
import numpy as np
from av.video.codeccontext import VideoCodecContext

from pipeline.signals import Image

ENCODERS = {
    "h264": ("libx264", {"preset": "ultrafast", "tune": "zerolatency", "profile": "baseline"}),
    "vp8": ("libvpx", {"deadline": "realtime", "cpu-used": "8", "lag-in-frames": "0"}),
}
DECODERS = {"h264": "h264", "vp8": "vp8"}
CODECS = ("h264", "vp8", "jpeg")
BLACK, WHITE = 16, 235
"""Of video luma."""
ALIGNMENT = 64
"""FFmpeg's pictures grow to a multiple of this to each side [px] before they are checked."""
MAX_SCANS = 32
"""Of a JPEG: a progressive one has about ten, and a small hostile one thousands, each a pass."""
SCAN = b"\xff\xda"


class DecodeError(ValueError):
    """Bytes that are no picture, or not the one that was announced."""


class Encoder:
    """A phone's encoder: no picture waits for the next one."""

    def __init__(
        self, width: int, height: int, frame_rate_hz: float, bitrate_bps: int, codec: str = "h264"
    ) -> None:
        """Encode pictures of one size.

        Raises:
            ValueError: an unknown codec.
        """
        if codec not in CODECS:
            raise ValueError(f"codec: {codec!r} is not one of {', '.join(CODECS)}")
        self.codec, self.width, self.height = codec, width, height
        self._count = 0
        self._context = None if codec == "jpeg" else self._open(frame_rate_hz, bitrate_bps)
        self._video_luma = np.round(BLACK + np.arange(256) * (WHITE - BLACK) / 255.0)
        self._key_every = round(2.0 * frame_rate_hz)

    def _open(self, frame_rate_hz: float, bitrate_bps: int) -> VideoCodecContext:
        name, options = ENCODERS[self.codec]
        context = av.CodecContext.create(name, "w")
        assert isinstance(context, VideoCodecContext)
        context.width, context.height, context.pix_fmt = self.width, self.height, "yuv420p"
        context.bit_rate = bitrate_bps
        context.time_base = Fraction(1, 90_000)
        context.framerate = Fraction(round(frame_rate_hz), 1)
        context.gop_size = 10_000
        context.options = dict(options)
        self._ticks = round(90_000 / frame_rate_hz)
        return context

    def encode(self, luma: Image, key: bool = False) -> tuple[bytes, bool]:
        """Encode a picture (height, width): its bytes, and whether they can be decoded alone."""
        if self._context is None:
            _, data = cv2.imencode(".jpg", luma, (cv2.IMWRITE_JPEG_QUALITY, 80))
            return data.tobytes(), True
        key = key or self._count % self._key_every == 0
        frame = av.VideoFrame(self.width, self.height, "yuv420p")
        plane = np.frombuffer(memoryview(frame.planes[0]), np.uint8).reshape(self.height, -1)
        cv2.LUT(luma, self._video_luma.astype(np.uint8), dst=plane[:, : self.width])
        for chroma in frame.planes[1:]:
            np.frombuffer(memoryview(chroma), np.uint8)[:] = 128
        frame.pts = self._count * self._ticks
        frame.pict_type = av.video.frame.PictureType.I if key else av.video.frame.PictureType.NONE
        self._count += 1
        return b"".join(bytes(packet) for packet in self._context.encode(frame)), key


class Decoder:
    """A server's decoder of one stream of one size."""

    def __init__(self, codec: str, width: int, height: int) -> None:
        """Begin with nothing decoded.

        Raises:
            ValueError: an unknown codec.
        """
        if codec not in CODECS:
            raise ValueError(f"codec: {codec!r} is not one of {', '.join(CODECS)}")
        self.codec, self.width, self.height = codec, width, height
        self._context = None if codec == "jpeg" else self._open()
        self._whole = False

    @property
    def full_range(self) -> bool:
        """Whether luma reaches from 0 to 255."""
        return self._context is None

    def _open(self) -> VideoCodecContext:
        context = av.CodecContext.create(DECODERS[self.codec], "r")
        assert isinstance(context, VideoCodecContext)
        coded = [-(-size // ALIGNMENT) * ALIGNMENT for size in (self.width, self.height)]
        context.options = {"max_pixels": str(coded[0] * coded[1])}
        context.thread_type = "SLICE"
        context.thread_count = 1
        return context

    def decode(self, data: bytes) -> Image:
        """Luma (height, width) of a picture; valid until the next call.

        Raises:
            DecodeError: garbage, damage, another size, or no key frame yet. A picture lost before
                this one does not show in the bytes: who loses one must go on at a key frame.
        """
        if not data:
            raise DecodeError("an empty picture")
        if self._context is None:
            return self._sized(self._jpeg(data, cv2.IMREAD_GRAYSCALE))
        return self._sized(self._luma(self._video(self._context, data)))

    def decode_colour(self, data: bytes) -> Image:
        """BGR (height, width, 3) of a picture.

        Raises:
            DecodeError: as by `decode`.
        """
        if not data:
            raise DecodeError("an empty picture")
        if self._context is None:
            return self._sized(self._jpeg(data, cv2.IMREAD_COLOR))
        frame = self._video(self._context, data)
        return self._sized(np.asarray(frame.to_ndarray(format="bgr24"), dtype=np.uint8))

    def _sized(self, image: Image) -> Image:
        if image.shape[:2] != (self.height, self.width):
            raise DecodeError(
                f"a picture of {image.shape[1]}x{image.shape[0]}, not {self.width}x{self.height}"
            )
        return image

    def _jpeg(self, data: bytes, colours: int) -> Image:
        size = jpeg_size(data)
        if size != (self.width, self.height):
            raise DecodeError(f"a JPEG of size {size}, not {self.width}x{self.height}")
        if data.count(SCAN) > MAX_SCANS:
            raise DecodeError(f"a JPEG of {data.count(SCAN)} scans; at most {MAX_SCANS} are taken")
        upright = colours | cv2.IMREAD_IGNORE_ORIENTATION  # as the sensor saw it
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), upright)
        except cv2.error as error:
            raise DecodeError(f"not a JPEG: {error}") from error
        if image is None:
            raise DecodeError("not a whole JPEG")
        return np.asarray(image, dtype=np.uint8)

    def _video(self, context: VideoCodecContext, data: bytes) -> av.VideoFrame:
        whole, self._whole = self._whole, False  # until all went well
        try:
            frames = context.decode(av.Packet(data))
        except av.error.FFmpegError as error:
            raise DecodeError(f"not {self.codec}: {error}") from error
        if not frames:
            raise DecodeError(f"no {self.codec} picture in these bytes: wait for a key frame")
        frame = frames[-1]
        # FFmpeg paints damage over with older pictures, and goes on from there: LEDs of the past
        if frame.is_corrupt or not (whole or frame.key_frame):
            raise DecodeError(f"damaged {self.codec}: wait for a key frame")
        if frame.format.name not in ("yuv420p", "yuvj420p", "nv12", "gray"):
            raise DecodeError(f"pictures of format {frame.format.name}, not yuv420p")
        self._whole = (frame.width, frame.height) == (self.width, self.height)
        return frame

    @staticmethod
    def _luma(frame: av.VideoFrame) -> Image:
        plane = frame.planes[0]
        rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
        luma: Image = rows[:, : plane.width]
        return luma


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) in a JPEG's frame header, without decoding; None if there is none."""
    at = 2
    if data[:2] != b"\xff\xd8":
        return None
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height = int.from_bytes(data[at + 5 : at + 7], "big")
            return int.from_bytes(data[at + 7 : at + 9], "big"), height
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
