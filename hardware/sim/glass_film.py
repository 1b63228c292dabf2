"""A screen as a phone films it: dim fiducials, and dots of light."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from hardware.sim.hand import Hand
from hardware.sim.render import RelativePoseAt, RenderOptions, render
from pipeline.camera.lens import Camera
from pipeline.frames import Array, R_from_rpy
from pipeline.glass.window import CELLS, MARKER_IDS, Glass, on_glass
from pipeline.signals import Image

CELL_PX = 8
"""Of the drawn tile."""
FINER = 4
"""A tile is put into the picture at so many times its size, then made smaller: smooth edges."""
DOT_M = 0.0015
"""Radius of a dot."""


def glass_before(hand: Hand, t: float, middle_in_f: Array, tilt_rad: float) -> RelativePoseAt:
    """Where a glass on a table is before the camera in a `hand` around `t` [s].

    Its middle is at `middle_in_f` (3,) [m]; its upper edge leans away by `tilt_rad`.
    """
    R_fg = R_from_rpy(np.array([0.0, -tilt_rad, 0.0]))

    def glass_at(dt: float) -> tuple[Array, Array]:
        R_fc, p_cf_in_f = hand.pose(t + dt)
        return R_fc.T @ R_fg, R_fc.T @ (middle_in_f - p_cf_in_f)

    return glass_at


def film(
    camera: Camera,
    glass_at: RelativePoseAt,
    glass: Glass,
    dots: Array,
    rng: np.random.Generator,
    grey: int = 70,
    look: RenderOptions | None = None,
) -> Image:
    """Luma of a picture of the glass at `glass_at` (R_cg, p_gc_in_c), with `dots` (n, 2) [m] lit.

    A fiducial's light parts are `grey` levels bright in the picture.
    """
    look = look or RenderOptions(led_radius_m=DOT_M, room=0.005)
    image = render(camera, glass_at, on_glass(dots), look, rng)
    fiducials = glass.fiducials().reshape(4, 4, 3)
    for name, corners in zip(MARKER_IDS, fiducials, strict=True):
        _put(image, _rolled(camera, glass_at, corners), grey / 255.0 * _tile(name))
    return image


def _rolled(camera: Camera, glass_at: RelativePoseAt, corners: Array) -> Array:
    """Pixels (4, 2) of a marker's corners (4, 3), each where it is when its line is read."""

    def pixels(corner: Array, delay_s: float) -> Array:
        R_cg, p_gc_in_c = glass_at(delay_s)
        return camera.pixels((p_gc_in_c + R_cg @ corner)[None])

    delays = [float(camera.delays(pixels(corner, 0.0))[0]) for corner in corners]
    return np.concatenate([pixels(*one) for one in zip(corners, delays, strict=True)])


@cache
def _tile(name: int) -> Array:
    """A marker with its quiet zone, 0 to 1, `CELL_PX` each cell."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    marker = cv2.aruco.generateImageMarker(family, name, (CELLS - 2) * CELL_PX)
    return np.pad(np.asarray(marker, dtype=np.float64) / 255.0, CELL_PX, constant_values=1.0)


def _put(image: Image, corners_px: Array, tile: Array) -> None:
    """Lighten the picture by a tile whose marker has these corners (4, 2)."""
    low, high = CELL_PX, len(tile) - CELL_PX
    source = np.array([[low, low], [high, low], [high, high], [low, high]]) - 0.5
    reach = np.ptp(corners_px, axis=0).max()
    left, top = np.floor(corners_px.min(axis=0) - reach).astype(int)
    size = int(np.ceil(3.0 * reach)) + 1
    target = (corners_px - (left, top) + 0.5) * FINER - 0.5
    H: Array = np.asarray(
        cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32)),
        dtype=np.float64,
    )
    first, end = _reached(H, len(tile), size)
    low_px = np.maximum(first, (-left, -top))
    width, height = np.minimum(end, (image.shape[1] - left, image.shape[0] - top)) - low_px
    if width <= 0 or height <= 0:
        return
    shift = np.eye(3)
    shift[:2, 2] = -FINER * low_px
    fine = cv2.warpPerspective(tile, shift @ H, (width * FINER, height * FINER))
    light = 255.0 * cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    x, y = low_px + np.array((left, top))
    part = image[y : y + height, x : x + width]
    part[:] = np.maximum(part, np.round(light).astype(np.uint8))


def _reached(H: Array, side: int, size: int) -> tuple[Array, Array]:
    """First and end (2,) of the pixels, 0 to `size`, that a tile of this side lightens."""
    edges = np.array([[[-1.0, -1.0], [side, -1.0], [side, side], [-1.0, side]]])
    px = (cv2.perspectiveTransform(edges, H)[0] + 0.5) / FINER
    first, end = np.floor(px.min(axis=0)), np.ceil(px.max(axis=0))
    return np.clip(first, 0, size).astype(int), np.clip(end, 0, size).astype(int)
