"""A film of a board, read picture by picture: what of it is used, and at what times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from server.calibration.board import Board, Detector
from server.calibration.views import BoardView, look
from server.export.recorded_film import open_film
from server.media.frame_source import TIMES

MOST_PICTURES = 1500
"""Of a longer film whole runs are left out."""
RUN = 5
"""Pictures in a row, so that the rates of the middle one can be told."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardVideo:
    """What a film shows of a board."""

    views: list[BoardView]
    size: tuple[int, int]
    """Width and height [px]."""
    pictures: int
    """How many were looked at."""
    timed: bool
    """Whether the times mean anything."""


class FilmError(ValueError):
    """A film that can't be used."""


def watch(
    path: Path, fps: float | None, board: Board, on_picture: Callable[[int, int | None], object]
) -> BoardVideo:
    """Look at a folder of pictures or a video; `on_picture` gets (done, of all).

    Raises:
        FilmError: pictures of different sizes, or none.
        InputError: what can't be read at all.
    """
    source, detector = open_film(path, fps), Detector(board)
    every = -(-source.count // MOST_PICTURES) if source.count else 1
    views: list[BoardView] = []
    size: tuple[int, int] | None = None
    looked = 0
    for index, shot in enumerate(source):
        on_picture(index, source.count)
        if shot.luma is None or (index // RUN) % every:
            continue
        height, width = shot.luma.shape
        if size is not None and size != (width, height):
            raise FilmError(
                f"{shot.name}: {width}x{height}, the pictures before are {size[0]}x{size[1]}:"
                " one size at a time"
            )
        size, looked = (width, height), looked + 1
        view = look(shot.luma, shot.t, board, detector)
        if view is not None:
            views.append(view)
    if size is None:
        raise FilmError(f"{path}: no picture could be read")
    timed = path.is_file() or fps is not None or (path / TIMES).exists()
    return BoardVideo(views, size, looked, timed)
