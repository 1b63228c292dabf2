"""Frames of a video file, with the file's own times."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import av.error
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.reformatter import ColorRange
from av.video.stream import VideoStream

from pipeline.signals import Image
from server.common.errors import InputError
from server.media.frame import MediaFrame

LUMA_FIRST = ("yuv420p", "yuvj420p", "yuv422p", "yuvj422p", "yuv444p", "yuvj444p", "nv12", "gray")
"""Formats whose first plane is 8 bit luma."""
DAMAGED = "Damaged: what is shown up to the next key frame is not true."


class Video:
    """A video file; a frame's name is its number."""

    def __init__(self, path: Path, fps: float | None = None) -> None:
        """See that it is one.

        Raises:
            InputError: it can't be read as a film.
        """
        self._path, self._fps = path, fps
        self.notes: list[str] = []
        try:
            with av.open(str(path)) as container:
                stream = self._stream(container)
                base = stream.time_base
                frames, ticks = stream.frames, stream.duration
                start = 0.0 if base is None else float((stream.start_time or 0) * base)
                length = None if base is None or ticks is None else float(ticks * base)
        except (av.error.FFmpegError, OSError) as error:
            raise InputError(path, "", f"neither a folder nor a film: {error.strerror}") from error
        self.count: int | None = frames or None
        self.span: tuple[float, float] | None = None
        if fps is None and length is not None:
            self.span = (start, start + length)

    def _stream(self, container: InputContainer) -> VideoStream:
        if not container.streams.video:
            raise InputError(self._path, "", "holds no video")
        return container.streams.video[0]

    def __iter__(self) -> Iterator[MediaFrame]:
        """Iterate over frames as decoded.

        Raises:
            InputError: it can't be decoded, or its times do not ascend.
        """
        number, last, damage, undated = 0, -np.inf, _Damage(), 0
        with av.open(str(self._path)) as container:
            stream = self._stream(container)
            stream.thread_type = "SLICE"  # not by frames: a packet's error must come with it
            for item in self._decoded(container, stream):
                whole = damage.spares(item)
                if isinstance(item, Packet) and stream.codec_context.has_b_frames:
                    undated += 1  # who knows between which frames
                    continue
                name, t = f"{number:06d}", self._time(item, number)
                if t <= last:
                    raise InputError(
                        self._path,
                        f"frame {name}",
                        f"{t:.6f} s comes after {last:.6f} s: try --fps",
                    )
                number, last = number + 1, t
                if whole and isinstance(item, VideoFrame):
                    yield MediaFrame(name, t, *_luma(item))
                else:
                    yield MediaFrame(name, t, None, problem=DAMAGED)
        if undated:
            self.notes.append(f"{undated} packets can't be decoded: their frames have no row")
        if number == 0:
            raise InputError(self._path, "", "not one frame of it can be decoded")

    def _decoded(
        self, container: InputContainer, stream: VideoStream
    ) -> Iterator[VideoFrame | Packet[VideoStream]]:
        """Decoded frames, and in place of some the packet that can't be decoded."""
        try:
            for packet in container.demux(stream):
                try:
                    frames = packet.decode()
                except av.error.FFmpegError:
                    packet.is_corrupt = True
                    yield packet
                    continue
                yield from (frame for frame in frames if isinstance(frame, VideoFrame))
        except av.error.FFmpegError as error:
            self.notes.append(f"the film breaks off: {error.strerror}")

    def _time(self, item: VideoFrame | Packet[VideoStream], number: int) -> float:
        if self._fps is not None:
            return number / self._fps
        if item.pts is None or item.time_base is None:
            raise InputError(self._path, f"frame {number:06d}", "has no time: give --fps")
        return float(item.pts * item.time_base)


def _is_key(item: VideoFrame | Packet[VideoStream]) -> bool:
    return isinstance(item, VideoFrame) and bool(item.key_frame)


class _Damage:
    """Spreads from frame to frame up to a key frame."""

    def __init__(self) -> None:
        self._since: int | None = None
        """Time stamp of the newest damaged one [ticks]; None: all is well."""

    def spares(self, item: VideoFrame | Packet[VideoStream]) -> bool:
        pts = item.pts or 0
        if item.is_corrupt:
            self._since = pts if self._since is None else max(self._since, pts)
        elif self._since is not None and _is_key(item) and pts > self._since:
            self._since = None
        return self._since is None


def _luma(frame: VideoFrame) -> tuple[Image, bool]:
    """Grey levels (height, width), and whether they reach from 0 to 255."""
    name = frame.format.name
    is_full = name.startswith("yuvj") or frame.color_range == ColorRange.JPEG
    if name not in LUMA_FIRST:
        is_yuv = name.startswith(("yuv", "p0", "nv"))
        if is_yuv:  # deeper ones among them; their range stays
            frame = frame.reformat(
                format="yuv444p",
                src_color_range=frame.color_range,
                dst_color_range=frame.color_range,
            )
        else:
            frame, is_full = frame.reformat(format="gray"), True
    elif name == "gray":
        is_full = frame.color_range != ColorRange.MPEG
    plane = frame.planes[0]
    rows = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)
    luma: Image = rows[:, : plane.width]
    return luma, is_full
