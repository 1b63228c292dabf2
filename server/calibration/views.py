"""Views of a board: corners named and measured, how sharp they are, how far the board is tilted."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image
from server.calibration.board import Board, Detector

FEWEST_CORNERS = 8
SAMPLES = 31
REACH = 0.25
"""Of a square: how far to both sides of an edge it is sampled."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """One image of the board."""

    t: float
    """When its middle row was exposed [s]."""
    ids: npt.NDArray[np.intp]
    """(n,) numbers of the corners."""
    pixels: Array
    """(n, 2), pixel centres at integers."""
    blur_px: float
    """Width of the board's black-white edges, of the worse direction."""

    def __len__(self) -> int:
        """Count of the corners."""
        return len(self.ids)


def look(luma: Image, t: float, board: Board, detector: Detector) -> BoardView | None:
    """Detect the board in an image; None where that is too little to be of use."""
    ids, pixels = detector.find(luma)
    if len(ids) < FEWEST_CORNERS or not _spans(ids, board):
        return None
    return BoardView(t, ids, pixels, edge_width(luma, ids, pixels, board))


def _spans(ids: npt.NDArray[np.intp], board: Board) -> bool:
    """Corners on three columns and three rows: a homography rests on them."""
    across, down = board.shape
    fewest = min(3, across, down)
    return min(len(np.unique(ids % across)), len(np.unique(ids // across))) >= fewest


def edge_width(luma: Image, ids: npt.NDArray[np.intp], pixels: Array, board: Board) -> float:
    """Contrast over steepest slope of the edges between neighbouring corners [px].

    A lens alone gives 2 to 3, motion of L pixels L; inf where no two neighbours were found.
    """
    across, down = board.shape
    at = np.full(across * down, -1)
    at[ids] = np.arange(len(ids))
    grid = at.reshape(down, across)
    widths = []
    for first, second in ((grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:])):
        both = (first >= 0) & (second >= 0)
        if both.any():
            a, b = pixels[first[both]], pixels[second[both]]
            widths.append(_width(luma, a, b))
    return max(widths, default=float("inf"))


def _width(luma: Image, a: Array, b: Array) -> float:
    """Median edge width [px] across the lines from a (n, 2) to b (n, 2)."""
    along = b - a
    length = np.maximum(np.sqrt((along * along).sum(axis=1)), 1e-6)
    normal = np.column_stack((-along[:, 1], along[:, 0])) / length[:, None]
    s = np.linspace(-REACH, REACH, SAMPLES)
    places = 0.5 * (a + b)[:, None] + (s * length[:, None])[..., None] * normal[:, None]
    u, v = (np.ascontiguousarray(places[..., k], dtype=np.float32) for k in (0, 1))
    profile = cv2.remap(luma, u, v, cv2.INTER_LINEAR).astype(np.float64)
    step = (s[1] - s[0]) * length[:, None]
    slopes = np.abs(np.diff(profile, axis=1)) / step
    # an edge's own line stands in the middle; a marker's lies further out
    middle = slopes[:, SAMPLES // 4 : -(SAMPLES // 4)]
    contrast = float(np.percentile(profile, 95) - np.percentile(profile, 5))
    return float(np.median(contrast / np.maximum(middle.max(axis=1), 1e-6)))


@dataclass(frozen=True, slots=True, eq=False)
class Aspect:
    """How a view shows the board, before the lens is known: enough to choose and to guide."""

    centre: Array
    """(2,) of the corners, 0 to 1 across and down the picture."""
    size: float
    """Diagonal of the corners over that of the picture."""
    tilt: Array
    """(2,) slopes of its depth to the right and down: 0 is parallel to the picture."""

    @property
    def tilt_deg(self) -> float:
        """Angle between the board's normal and the optical axis."""
        return float(np.rad2deg(np.arctan(np.sqrt(self.tilt @ self.tilt))))


def aspect(view: BoardView, board: Board, size: tuple[int, int], focal_px: float) -> Aspect:
    """Place, size and tilt of the board in a view, for a guess of the focal length."""
    half = 0.5 * np.array(size)
    flat = (view.pixels - half) / focal_px
    corners = board.corners()[view.ids, :2]
    H, _ = cv2.findHomography(corners, flat)
    tilt = np.zeros(2) if H is None else _tilt(np.array(H, dtype=float))
    spread = np.ptp(view.pixels, axis=0)
    centre = view.pixels.mean(axis=0) / size
    share = float(np.sqrt(spread @ spread) / np.sqrt(half @ half) / 2.0)
    return Aspect(centre, share, tilt)


def _tilt(H: Array) -> Array:
    """Slopes (2,) of the board's depth along the picture, by its homography to the plane ahead.

    Against the picture's plane, not the line of sight: a board parallel to it tells no focal
    length, wherever it stands.
    """
    normal = np.cross(H[:, 0], H[:, 1])
    tilt: Array = -normal[:2] / max(abs(float(normal[2])), 1e-9) * np.sign(normal[2])
    return tilt
