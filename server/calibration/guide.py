"""What a film of the board still lacks, while it is being filmed: progress and one hint at a time.

Sans-I/O: views go in with their times, words come out.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array
from server.calibration.board import Board
from server.calibration.choice import coverage, features, guessed_focal, sharp_limit
from server.calibration.verdict import TILT_DEG, bare_side
from server.calibration.views import Aspect, BoardView, aspect

MOST_VIEWS = 1800
"""A minute of film."""
PATIENCE_S, END_S = 45.0, 150.0
"""After the first, nobody is asked to turn any faster; after the second, it must do."""
NEW_VIEW = 0.08
"""Distance from all views before that makes one another view."""
VIEWS, DIFFERENT = 150, 30
"""Enough of them: with the board in it, and unlike each other."""
COVERED, EACH_TILT, TURNING = 0.85, 8, 50
"""Enough: share of the cells, views tilted to each side, views while turning."""
DEPTH = 1.6
"""Ratio of the largest board to the smallest."""
FAST = 0.2
"""Widths of the picture a second: turning that shows the readout."""
NEAR_S = 0.3
"""Views further apart in time don't tell how fast the phone turned."""
UNSEEN_S = 0.8
RECENT = 9
"""Views whose blur counts for the hint."""
BLUR_EVERY = 5
"""What the film's sharpest views are is judged by each so-many-th."""
SMALL = 0.22
"""Share of the picture that a board fills, below which its corners are too coarse."""
SIDES = ("from the left", "from the right", "from above", "from below")


@dataclass(frozen=True, slots=True)
class Coverage:
    """0 to 1 each."""

    covered: float
    tilted: float
    near_and_far: float
    turned: float
    filmed: float

    @property
    def share(self) -> float:
        """Share of the whole that is done."""
        parts = (self.covered, self.tilted, self.near_and_far, self.turned, self.filmed)
        return sum(parts) / len(parts)


class Guide:
    """Watches one film."""

    def __init__(self, board: Board, size: tuple[int, int]) -> None:
        """`size`: width and height of the pictures [px]."""
        self.size, self.views = size, list[BoardView]()
        self.cells = coverage([], size)
        self.pictures = 0
        self.last: BoardView | None = None
        """In the newest picture."""
        self._board = board
        self._chosen: list[Array] = []
        self._tilted = [0, 0, 0, 0]
        self._sizes: list[float] = []
        self._turning = 0
        self._blurs: deque[float] = deque(maxlen=RECENT)
        self._film_blurs: list[float] = []
        self._t_seen = self._t = self._t_first = -np.inf

    def add(self, t: float, view: BoardView | None) -> None:
        """A picture was looked at, with a board in it or without."""
        self.pictures += 1
        before, self.last, self._t = self.last, view, t
        if self.pictures == 1:
            self._t_seen = self._t_first = t
        if view is None or len(self.views) >= MOST_VIEWS:
            return
        self._t_seen = t
        self.views.append(view)
        self._blurs.append(view.blur_px)
        if len(self.views) % BLUR_EVERY == 1:
            self._film_blurs.append(view.blur_px)
        if view.blur_px > self._limit:
            return
        self.cells += coverage([view], self.size)
        one = aspect(view, self._board, self.size, guessed_focal(self.size))
        self._sort(one)
        if before is not None and view.t - before.t < NEAR_S:
            self._turning += _speed(before, view) > FAST * max(self.size)

    @property
    def _limit(self) -> float:
        return sharp_limit(np.array(self._film_blurs), max(self.size))

    def _sort(self, one: Aspect) -> None:
        right, down = one.tilt
        slope = float(np.tan(np.deg2rad(TILT_DEG)))
        # depth rises to the right: the camera looks from the left
        for side, lean in enumerate((right, -right, down, -down)):
            self._tilted[side] += bool(lean > slope)
        row = features(one)
        if all(((row - other) ** 2).sum() > NEW_VIEW**2 for other in self._chosen):
            self._chosen.append(row)
            self._sizes.append(one.size)

    @property
    def progress(self) -> Coverage:
        """How much is there."""
        ratio = max(self._sizes) / max(min(self._sizes), 1e-3) if self._sizes else 1.0
        tilts = [min(count / EACH_TILT, 1.0) for count in self._tilted]
        return Coverage(
            min(float((self.cells > 0).mean()) / COVERED, 1.0),
            sum(tilts) / len(tilts),
            min(float(np.log(ratio) / np.log(DEPTH)), 1.0),
            min(self._turning / TURNING, 1.0),
            min(len(self._chosen) / DIFFERENT, len(self.views) / VIEWS, 1.0),
        )

    @property
    def enough(self) -> bool:
        """Whether a calibration should be tried."""
        now, since = self.progress, self._t - self._t_first
        but_turned = min(now.covered, now.tilted, now.near_and_far, now.filmed) >= 1.0
        return (
            now.share >= 1.0
            or (but_turned and since > PATIENCE_S)
            or since > END_S
            or len(self.views) >= MOST_VIEWS
        )

    @property
    def blurred(self) -> bool:
        """Whether most of the last views were."""
        sharp = sum(blur <= self._limit for blur in self._blurs)
        return len(self._blurs) >= 3 and sharp < 0.5 * len(self._blurs)

    @property
    def hint(self) -> str:
        """Hint what to do now."""
        if self._t - self._t_seen > UNSEEN_S or not self.views:
            return "Point the camera at the board: all of it lit, about half the picture wide."
        if self.blurred:
            return "Blurred: move more slowly, or bring more light."
        if self._sizes and max(self._sizes) < SMALL:
            return "Go nearer: the board should fill a third of the picture."
        now = self.progress
        if now.covered < 1.0:
            return f"Turn the phone until the board is {bare_side(self.cells)}."
        if now.tilted < 1.0:
            side = SIDES[self._tilted.index(min(self._tilted))]
            return f"Look at the board {side}, at {TILT_DEG:g} to 45 degrees."
        if now.near_and_far < 1.0:
            return "Now from further away, then from near by."
        if now.turned < 1.0:
            return "Now turn the phone to and fro, about once a second, the board in view."
        return "Go on like that, always a little different."

    def outline(self) -> list[float]:
        """Corners of the board in the newest picture, 0 to 1: u, v of up to four points."""
        view = self.last
        if view is None:
            return []
        across, _ = self._board.shape
        column, row = view.ids % across, view.ids // across
        ends = [np.argmin(row + column), np.argmax(column - row)]
        ends += [np.argmax(row + column), np.argmin(column - row)]
        places: list[float] = (view.pixels[ends] / self.size).clip(0.0, 1.0).ravel().tolist()
        return [round(place, 4) for place in places]


def _speed(before: BoardView, view: BoardView) -> float:
    """Median motion of the corners in both views [px/s]."""
    _, a, b = np.intersect1d(before.ids, view.ids, return_indices=True)
    if len(a) == 0:
        return 0.0
    off = view.pixels[b] - before.pixels[a]
    dt = max(view.t - before.t, 1e-3)
    return float(np.median(np.sqrt((off * off).sum(axis=1)))) / dt
