"""Initialisation of the bundle adjustment: a focal length by trial, poses by PnP."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from pipeline.frames import Array
from server.calibration.board import Board
from server.calibration.lens import COEFFICIENTS, normalised
from server.calibration.projection import Guess
from server.calibration.views import BoardView

FOCALS = np.geomspace(0.35, 3.0, 16)
"""Tried, over the picture's longer side."""
TRIED_VIEWS = 16
"""Enough to begin with: all are solved for afterwards."""
OUTLIER_PX = 20.0
_EYE, _NONE = np.eye(3), np.zeros(4)


def poses(model: str, lens: Array, views: Sequence[BoardView], board: Board) -> tuple[Array, Array]:
    """R_og (n, 3, 3) and p_go_in_o (n, 3) of each view."""
    corners = board.corners()
    R, p = np.zeros((len(views), 3, 3)), np.zeros((len(views), 3))
    for k, view in enumerate(views):
        flat = np.clip(normalised(model, lens, view.pixels), -10.0, 10.0)
        _, turn, place = cv2.solvePnP(corners[view.ids], flat, _EYE, _NONE, flags=cv2.SOLVEPNP_IPPE)
        R[k], p[k] = cv2.Rodrigues(turn)[0], np.asarray(place).ravel()
    return R, p


def plain_lens(model: str, size: tuple[int, int], focal_px: float) -> Array:
    """A lens without distortion that looks at the middle of the picture."""
    middle = 0.5 * (np.array(size) - 1.0)
    return np.array([focal_px, focal_px, *middle, *np.zeros(COEFFICIENTS[model])])


def first_guess(
    model: str, views: Sequence[BoardView], board: Board, size: tuple[int, int]
) -> Guess:
    """The best of some focal lengths; readout and rates are zero."""
    tried = views[:TRIED_VIEWS]
    costs = [_cost(model, tried, board, plain_lens(model, size, max(size) * f)) for f in FOCALS]
    lens = plain_lens(model, size, max(size) * float(FOCALS[int(np.argmin(costs))]))
    R, p = poses(model, lens, views, board)
    return Guess(np.append(lens, 0.0), R, p, np.zeros((len(views), 6)))


def _cost(model: str, views: Sequence[BoardView], board: Board, lens: Array) -> float:
    """Mean reprojection error [px], each corner's bounded."""
    corners, focal, errors = board.corners(), float(lens[0]), []
    R, p = poses(model, lens, views, board)
    for k, view in enumerate(views):
        points = corners[view.ids] @ R[k].T + p[k]
        if (points[:, 2] <= 0.0).any():
            errors.append(OUTLIER_PX)
            continue
        off = points[:, :2] / points[:, 2:] - normalised(model, lens, view.pixels)
        errors.append(min(focal * float(np.sqrt((off * off).sum(axis=1).mean())), OUTLIER_PX))
    return float(np.mean(errors))
