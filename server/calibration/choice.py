"""Choice of the views to rest on: sharp, and as different from each other as they come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from server.calibration.board import Board
from server.calibration.views import Aspect, BoardView, aspect

FOCAL_GUESS = 0.75
"""Of the picture's longer side: a phone's rear camera, before anything is known."""
CELLS = (8, 6)
"""Columns and rows of the coverage map."""
MOST_VIEWS = 120
HELD_OUT = 4
"""Each so-many-th chosen view is kept out of the fit, to judge it."""
SHARP_SHARE, SHARP_PX = 1.8, 3.5
"""A view is sharp when its edges are no wider than so many times the sharpest ones, or than this
at 1280 pixels across."""
MOST_BLUR_PX = 8.0
"""At 1280 pixels across."""
ALIKE = 0.02
"""Views nearer than this to a chosen one add nothing."""


def guessed_focal(size: tuple[int, int]) -> float:
    """[px]."""
    return FOCAL_GUESS * max(size)


def coverage(views: Sequence[BoardView], size: tuple[int, int]) -> npt.NDArray[np.intp]:
    """Coverage (rows, columns): how many corners fell into each cell of the picture."""
    columns, rows = CELLS
    counts = np.zeros((rows, columns), dtype=np.intp)
    for view in views:
        u = np.clip(view.pixels[:, 0] / size[0] * columns, 0, columns - 1).astype(int)
        v = np.clip(view.pixels[:, 1] / size[1] * rows, 0, rows - 1).astype(int)
        np.add.at(counts, (v, u), 1)
    return counts


def sharp_limit(blurs: Array, width: int) -> float:
    """Edges up to this width [px] are sharp for this film."""
    scale = width / 1280.0
    floor = max(SHARP_PX * scale, 2.5)
    if len(blurs) == 0:
        return floor
    own = SHARP_SHARE * float(np.percentile(blurs, 15))
    return min(max(own, floor), max(MOST_BLUR_PX * scale, 5.0))


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """Views for the fit and views to judge it by."""

    fit: list[BoardView]
    held_out: list[BoardView]
    sharp: list[BoardView]
    """All that were good enough."""
    aspects: list[Aspect]
    """Of the chosen ones."""
    blur_px: float
    """Median over the film."""


def choose(views: Sequence[BoardView], board: Board, size: tuple[int, int]) -> Choice:
    """Farthest first: each next view is the one least like those already chosen."""
    blurs = np.array([view.blur_px for view in views])
    limit = sharp_limit(blurs, max(size))
    sharp = [view for view in views if view.blur_px <= limit]
    aspects = [aspect(view, board, size, guessed_focal(size)) for view in sharp]
    order = farthest_first(np.array([features(one) for one in aspects]).reshape(-1, 5), MOST_VIEWS)
    held = order[HELD_OUT - 1 :: HELD_OUT] if len(order) >= 3 * HELD_OUT else []
    kept = [k for k in order if k not in set(held)]
    return Choice(
        [sharp[k] for k in kept],
        [sharp[k] for k in held],
        sharp,
        [aspects[k] for k in order],
        float(np.median(blurs)) if len(blurs) else float("inf"),
    )


def features(one: Aspect) -> Array:
    """Features (5,) in which a distance of 1 means quite another view."""
    tilt = np.clip(one.tilt, -1.2, 1.2)
    return np.array([*one.centre, np.log(max(one.size, 1e-3)), *tilt])


def farthest_first(rows: Array, most: int) -> list[int]:
    """Indices of up to `most` rows (n, k), from the largest board on, each far from all before."""
    if len(rows) == 0:
        return []
    chosen = [int(np.argmax(rows[:, 2]))]
    distance = np.full(len(rows), np.inf)
    while len(chosen) < most:
        off = rows - rows[chosen[-1]]
        distance = np.minimum(distance, np.sqrt((off * off).sum(axis=1)))
        following = int(np.argmax(distance))
        if distance[following] < ALIKE:
            break
        chosen.append(following)
    return chosen
