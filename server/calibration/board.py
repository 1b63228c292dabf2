"""ChArUco boards: what they are, where their corners lie, how a detector finds them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image

SIDES = (3, 20)
"""Fewest and most squares along one side."""
MARKER_RATIO = 0.75  # side of a marker, of its square's
DICTIONARIES = {
    "4X4_250": cv2.aruco.DICT_4X4_250,
    "5X5_250": cv2.aruco.DICT_5X5_250,
    "6X6_250": cv2.aruco.DICT_6X6_250,
    "4X4_50": cv2.aruco.DICT_4X4_50,
    "5X5_100": cv2.aruco.DICT_5X5_100,
    "ARUCO_ORIGINAL": cv2.aruco.DICT_ARUCO_ORIGINAL,
}
"""Of OpenCV, the first is ours."""
MARKERS = {"4X4_50": 50, "5X5_100": 100, "ARUCO_ORIGINAL": 1024}


class BoardError(ValueError):
    """A board that can't be made; the text says what is allowed."""


@dataclass(frozen=True, slots=True)
class Board:
    """A chessboard with markers in its white squares."""

    columns: int = 9
    rows: int = 6
    square_m: float = 0.025
    marker_m: float = 0.025 * MARKER_RATIO
    dictionary: str = next(iter(DICTIONARIES))
    legacy: bool = False
    """As OpenCV drew boards with an even number of rows before 4.6."""

    def __post_init__(self) -> None:
        """Refuse what OpenCV would fail on later."""
        if not all(SIDES[0] <= n <= SIDES[1] for n in (self.columns, self.rows)):
            raise BoardError(f"board: {SIDES[0]} to {SIDES[1]} squares along each side, as in 9x6")
        if not 0.001 <= self.square_m <= 1.0:
            raise BoardError("square: 1 to 1000 mm")
        if not 0.3 * self.square_m <= self.marker_m < self.square_m:
            raise BoardError("marker: 0.3 to 1 times the square")
        if self.dictionary not in DICTIONARIES:
            raise BoardError(f"dictionary: one of {', '.join(DICTIONARIES)}")
        most = MARKERS.get(self.dictionary, 250)
        if self.columns * self.rows // 2 > most:
            raise BoardError(f"board: {self.dictionary} has {most} markers, which is too few")

    @property
    def shape(self) -> tuple[int, int]:
        """Inner corners along x and y."""
        return self.columns - 1, self.rows - 1

    def corners(self) -> Array:
        """Places (n, 3) of the inner corners on the board [m], in the order of their numbers."""
        across, down = self.shape
        index = np.arange(across * down)
        steps = (index % across + 1.0, index // across + 1.0, np.zeros(len(index)))
        places: Array = self.square_m * np.column_stack(steps)
        return places

    def drawn_by_opencv(self) -> cv2.aruco.CharucoBoard:
        """The board as OpenCV knows it."""
        dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARIES[self.dictionary])
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows), self.square_m, self.marker_m, dictionary
        )
        board.setLegacyPattern(self.legacy)
        return board


def parse(
    size: str, square_mm: float, marker_mm: float | None, dictionary: str, legacy: bool
) -> Board:
    """A board from the words of the command line.

    Raises:
        BoardError: says what is allowed.
    """
    match = re.fullmatch(r"(\d{1,3})[x×](\d{1,3})", size)
    if match is None:
        raise BoardError(f"board: squares along x and y, as in 9x6, not {size!r}")
    square_m = 1e-3 * square_mm
    marker_m = MARKER_RATIO * square_m if marker_mm is None else 1e-3 * marker_mm
    return Board(int(match[1]), int(match[2]), square_m, marker_m, dictionary, legacy)


class Detector:
    """Finds a board's corners in pictures."""

    def __init__(self, board: Board) -> None:
        """Detect one board; keeps OpenCV's tables."""
        parameters = cv2.aruco.DetectorParameters()
        parameters.adaptiveThreshWinSizeMin = 7
        parameters.adaptiveThreshWinSizeMax = 43
        parameters.adaptiveThreshWinSizeStep = 18
        self._detector = cv2.aruco.CharucoDetector(
            board.drawn_by_opencv(), cv2.aruco.CharucoParameters(), parameters
        )

    def find(self, luma: Image) -> tuple[npt.NDArray[np.intp], Array]:
        """Numbers (n,) and pixels (n, 2) of the corners in a picture; none is a normal answer."""
        corners: Any
        ids: Any
        corners, ids, _, _ = self._detector.detectBoard(np.ascontiguousarray(luma))
        if ids is None or corners is None or len(ids) == 0:
            return np.zeros(0, dtype=np.intp), np.zeros((0, 2))
        numbers = np.asarray(ids, dtype=np.intp).ravel()
        return numbers, np.asarray(corners, dtype=np.float64).reshape(-1, 2)
