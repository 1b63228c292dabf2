"""Frames one after the other, from a folder of pictures or a film, each with its time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from pipeline.signals import Image
from server.common.errors import InputError
from server.media.frame import MediaFrame
from server.media.tables import load_times

SUFFIXES = (".png", ".jpg", ".jpeg")
TIMES = "times.csv"
FPS = 30.0
"""Without any times."""
RATES_HZ = 0.01, 10_000.0
"""Pictures a second that somebody may say there are."""
DEEP = 4096
"""Grey levels of a 12 bit sensor."""


class Frames(Protocol):
    """Where frames come from."""

    @property
    def count(self) -> int | None:
        """How many, if that is known."""

    @property
    def span(self) -> tuple[float, float] | None:
        """Times of the first and the last [s], if they are known."""

    @property
    def notes(self) -> list[str]:
        """Notes for the user, complete after the last frame."""

    def __iter__(self) -> Iterator[MediaFrame]:
        """Iterate in the order of time."""


def open_frames(path: Path, fps: float | None = None) -> Frames:
    """Frames of a folder or of a film.

    Args:
        path: Which.
        fps: Frames per second where nothing else dates them; of a film: in place of its own times.

    Raises:
        InputError: there is nothing to read, or its times can't be used.
    """
    if path.is_dir():
        return Folder(path, fps)
    if not path.exists():
        raise InputError(path, "", "no such folder or film")
    if path.suffix.lower() in SUFFIXES:
        raise InputError(path, "", "is one picture: name the folder of all")
    from server.media.video import Video

    return Video(path, fps)


class Folder:
    """PNG and JPEG files in the order of their names."""

    def __init__(self, path: Path, fps: float | None = None) -> None:
        """Read which there are, and their times.

        Raises:
            InputError: no frames, or their times can't be used.
        """
        self._path = path
        files = [file for file in path.iterdir() if file.suffix.lower() in SUFFIXES]
        self._files = sorted((f for f in files if not f.name.startswith(".")), key=lambda f: f.name)
        self.notes: list[str] = []
        self._deepest = 0
        if not self._files:
            raise InputError(path, "", f"holds no frames ({', '.join(SUFFIXES)})")
        self._times = self._dated(fps)

    @property
    def count(self) -> int | None:
        """Count of all frames."""
        return len(self._files)

    @property
    def span(self) -> tuple[float, float] | None:
        """Times of the first and the last [s]."""
        return self._times[0], self._times[-1]

    def __iter__(self) -> Iterator[MediaFrame]:
        """Iterate in the order of names, which is that of time."""
        for file, t in zip(self._files, self._times, strict=True):
            luma = self._read(file)
            problem = "" if luma is not None else "The file can't be read as a picture."
            yield MediaFrame(file.name, t, luma, True, problem)
        if 0 < self._deepest < DEEP:
            self.notes.append(
                f"16 bit frames never exceed {self._deepest}: scale them to 65535 if that is white"
            )

    def _dated(self, fps: float | None) -> list[float]:
        file = self._path / TIMES
        if not file.exists():
            if fps is None:
                self.notes.append(f"no {TIMES} and no --fps: taken as {FPS:g} frames a second")
            return [k / (fps or FPS) for k in range(len(self._files))]
        if fps is not None:
            self.notes.append(f"--fps is not used: {TIMES} dates the frames")
        table = load_times(file)
        names = [frame.name for frame in self._files]
        known = set(names)
        for name, (line, _) in table.items():
            if name not in known:
                raise InputError(file, f"line {line}", f"there is no frame {name!r} in the folder")
        undated = [name for name in names if name not in table]
        if undated:
            raise InputError(file, "", f"{len(undated)} frames have no time, first {undated[0]!r}")
        self._check_order(file, list(table.items()), names)
        return [table[name][1] for name in names]

    def _check_order(
        self, file: Path, rows: list[tuple[str, tuple[int, float]]], names: list[str]
    ) -> None:
        """Frames are looked at in the order of their names: it must be that of time."""
        for (name, (line, _)), wanted in zip(rows, names, strict=True):
            if name != wanted:
                raise InputError(
                    file,
                    f"line {line}",
                    f"{name!r} where {wanted!r} comes by name: the order of names must be that of"
                    " time (numbers with leading zeros)",
                )

    def _read(self, file: Path) -> Image | None:
        """Read as the sensor saw it: a JPEG's orientation is not followed."""
        try:
            data = np.fromfile(file, np.uint8)
            if len(data) == 0:
                return None
            flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
            image = cv2.imdecode(data, flags)
        except (OSError, cv2.error):
            return None
        if image is None or image.ndim != 2:
            return None
        if image.dtype == np.uint16:
            self._deepest = max(self._deepest, int(image.max()))
            image = cv2.convertScaleAbs(image, alpha=255.0 / 65535.0)
        return np.asarray(image, dtype=np.uint8) if image.dtype == np.uint8 else None
