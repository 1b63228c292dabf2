"""A recording as a film and motion samples, for tools that take films."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.frames import Array
from pipeline.signals import BodyImu, PhoneImu
from server.common.errors import InputError
from server.export.decoded import DatedPicture, DecodedRecording
from server.media.frame import MediaFrame
from server.media.frame_source import Frames, open_frames
from server.phone.decoder import FrameDecoder
from server.phone.ingest import EncodedFrame
from server.recording.reader import read
from server.recording.writer import RecordingError

SUFFIX = ".mcap"
UNDECODABLE = "It leans on a picture that is not in the recording."


def open_film(path: Path, fps: float | None = None) -> Frames:
    """Frames of a folder, a film or a recording.

    Raises:
        InputError: there is nothing to read, or its times can't be used.
    """
    if path.suffix != SUFFIX:
        return open_frames(path, fps)
    if fps is not None:
        raise InputError("--fps", "", "a recording dates its pictures itself")
    return RecordedFilm(_opened(path))


def imu_samples(path: Path) -> tuple[Array | None, Array | None]:
    """Samples (n, 7) t [s], rate [rad/s], force [m/s²] of phone, in c, and robot, in b; None: none.

    Of what is no recording there are none.

    Raises:
        InputError: the recording is damaged.
    """
    if path.suffix != SUFFIX:
        return None, None
    phone: list[list[float]] = []
    robot: list[list[float]] = []
    for item in _guarded(_opened(path)):
        match item:
            case PhoneImu(t, rate, force):
                phone.append([t, *rate, *force])
            case BodyImu(t, rate, force):
                robot.append([t, *rate, *force])
    return _table(phone), _table(robot)


class RecordedFilm:
    """Pictures of a recording, by their numbers; their times are those of capture."""

    def __init__(self, decoded: DecodedRecording) -> None:
        """See how many there are, and when.

        Raises:
            InputError: the recording is damaged, or has none.
        """
        self._decoded = decoded
        times = [item.t for item in _guarded(decoded) if isinstance(item, DatedPicture)]
        if not times:
            raise InputError(decoded.recording.path, "", "holds no picture; name another recording")
        self.count: int | None = len(times)
        self.span = min(times), max(times)
        self.notes: list[str] = []

    def __iter__(self) -> Iterator[MediaFrame]:
        """Iterate in the order of time.

        Raises:
            InputError: the recording is damaged.
        """
        decoder, size, last = FrameDecoder(0, 0), (0, 0), -np.inf
        left_out = 0
        for item in _guarded(self._decoded):
            if not isinstance(item, DatedPicture):
                continue
            if size != (item.picture.width, item.picture.height):
                size = item.picture.width, item.picture.height
                decoder = FrameDecoder(*size)
            luma = decoder.decoded(
                EncodedFrame(item.t, item.t_received, item.sequence, item.picture)
            )
            if item.t <= last:
                left_out += 1
                continue
            last = item.t
            problem = UNDECODABLE if luma is None else ""
            yield MediaFrame(f"{item.sequence:06d}", item.t, luma, decoder.full_range, problem)
        if left_out:
            self.notes.append(f"{left_out} pictures are not later than those before: left out")


def _opened(path: Path) -> DecodedRecording:
    try:
        return DecodedRecording(read(path))
    except RecordingError as error:
        raise InputError(path, "", f"{error.what}; {error.allowed}") from error


def _guarded(decoded: DecodedRecording) -> Iterator[object]:
    try:
        yield from decoded.items()
    except RecordingError as error:
        raise InputError(error.path, "", f"{error.what}; {error.allowed}") from error


def _table(rows: list[list[float]]) -> Array | None:
    """In the order of time, each once."""
    if len(rows) < 2:  # to interpolate between
        return None
    table = np.array(rows)
    return table[np.unique(table[:, 0], return_index=True)[1]]
