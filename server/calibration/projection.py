"""A filmed board as a camera with a rolling shutter sees it, with derivatives by everything.

The board moves past the camera: at a delay τ of its line from the picture's middle one a corner X
stands at Exp(τ ω) R X + p + τ v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from server.calibration.board import Board
from server.calibration.lens import project
from server.calibration.views import BoardView

POSE, BOTH = 6, 12
"""Parameters of a view: turn and place, or these and the rates."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardCorners:
    """Corners of all views, one below the other."""

    model: str
    corners_in_g: Array
    """(m, 3) on the board [m]."""
    pixels: Array
    """(m, 2)."""
    shares: Array
    """(m,) of the readout, from the middle line to the corner's: −½ to ½."""
    view: npt.NDArray[np.intp]
    """(m,) whose corner it is, ascending."""
    starts: npt.NDArray[np.intp]
    """(n,) where each view begins."""

    def __len__(self) -> int:
        """Count of the views."""
        return len(self.starts)


def film_of(
    views: Sequence[BoardView], board: Board, model: str, size: tuple[int, int], axis: int
) -> BoardCorners:
    """Views as one stack of corners; `axis` counts the lines of the rolling shutter."""
    counts = np.array([len(view) for view in views])
    corners = board.corners()
    pixels = np.concatenate([view.pixels for view in views])
    return BoardCorners(
        model,
        np.concatenate([corners[view.ids] for view in views]),
        pixels,
        pixels[:, axis] / size[axis] - 0.5,
        np.repeat(np.arange(len(views)), counts),
        np.concatenate(([0], np.cumsum(counts)[:-1])),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """A value of every parameter."""

    shared: Array
    """(5 + k,) lens and, last, readout [s]."""
    R_og: Array
    """(n, 3, 3) board's axes g in the optical ones."""
    p_go_in_o: Array
    """(n, 3) [m]."""
    rates: Array
    """(n, 6) of the board relative to the camera: ω [rad/s] and v [m/s], in o."""


def _moved(film: BoardCorners, guess: Guess) -> tuple[Array, Array, Array]:
    """Corners in o (m, 3), R X alone (m, 3), delays (m,)."""
    delay = film.shares * guess.shared[-1]
    turned = np.einsum("mij,mj->mi", guess.R_og[film.view], film.corners_in_g)
    rates = guess.rates[film.view]
    swung = rotated(delay[:, None] * rates[:, :3], turned)
    return swung + guess.p_go_in_o[film.view] + delay[:, None] * rates[:, 3:], swung, delay


def rotated(theta: Array, x: Array) -> Array:
    """Exp(θ) x for each row (m, 3)."""
    n2 = (theta * theta).sum(axis=1, keepdims=True)
    n = np.sqrt(np.maximum(n2, 1e-18))
    s, c = np.sin(n) / n, (1.0 - np.cos(n)) / np.maximum(n2, 1e-18)
    first = np.cross(theta, x)
    rotated: Array = x + s * first + c * np.cross(theta, first)
    return rotated


def _skews(x: Array) -> Array:
    """(m, 3, 3) cross product matrices of rows (m, 3)."""
    out = np.zeros((len(x), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -x[:, 2], x[:, 1], -x[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = x[:, 2], -x[:, 1], x[:, 0]
    return out


def residuals_of(film: BoardCorners, guess: Guess) -> Array:
    """Measured minus foreseen pixels (m, 2)."""
    points, _, _ = _moved(film, guess)
    return film.pixels - project(film.model, guess.shared[:-1], points)[0]


def linear(film: BoardCorners, guess: Guess, width: int) -> tuple[Array, Array, Array]:
    """Residuals (m, 2), derivatives of the pixels by view (m, 2, w) and shared (m, 2, s)."""
    points, swung, delay = _moved(film, guess)
    pixels, by_point, by_lens = project(film.model, guess.shared[:-1], points)
    by_turn = -by_point @ _skews(swung)
    J_view = np.concatenate((by_turn, by_point), axis=2)
    if width == BOTH:
        J_view = np.concatenate((J_view, delay[:, None, None] * J_view), axis=2)
    rates = guess.rates[film.view]
    speed = np.cross(rates[:, :3], swung) + rates[:, 3:]
    by_readout = np.einsum("mij,mj->mi", by_point, speed) * film.shares[:, None]
    return film.pixels - pixels, J_view, np.concatenate((by_lens, by_readout[..., None]), axis=2)
