"""The glass of a screen: where its fiducials are, and where light seen through it pierces it.

Frame g: origin in the middle of the glass, x into it, away from who looks, y left, z up. Places
on the glass are (right, up) [m] from its middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.frames import GRAVITY, Array, R_fc_level_from_specific_force

MARKER_IDS = (246, 247, 248, 249)
"""Of ArUco's 4X4_250, at top left, top right, bottom right, bottom left: a calibration board has
the first ones."""
TILE_SHARE = 0.2
"""Side of a marker with its quiet zone, of the glass's height: 1 pixel a cell at 4 m."""
CELLS = 8
"""Across a tile: four of the code, a dark border and a grey quiet zone."""
LEAST_AHEAD_M = 0.02
"""Light so near to the eye, or nearer, can't be drawn."""


@dataclass(frozen=True, slots=True)
class Glass:
    """The lit part of a screen."""

    width_m: float
    height_m: float

    @property
    def tile_m(self) -> float:
        """Side of a marker with its quiet zone, in each corner of the glass."""
        return TILE_SHARE * self.height_m

    def fiducials(self) -> Array:
        """Corners (16, 3) of the markers in g [m]: of each from top left, clockwise."""
        outer, tile = np.array([0.5 * self.width_m, 0.5 * self.height_m]), self.tile_m
        inner = np.array([[1.0, 1.0], [CELLS - 1.0, 1.0], [CELLS - 1.0] * 2, [1.0, CELLS - 1.0]])
        corners = []
        for right, low in ((0, 0), (1, 0), (1, 1), (0, 1)):
            start = np.array([right, low]) * (2.0 * outer - tile)
            down = start + inner * tile / CELLS
            corners.append(np.column_stack((down[:, 0] - outer[0], outer[1] - down[:, 1])))
        return on_glass(np.concatenate(corners))

    def has(self, places: Array) -> npt.NDArray[np.bool_]:
        """(n,) whether places (n, 2) are on the glass; nowhere (NaN) is not."""
        inside = np.abs(places) <= 0.5 * np.array([self.width_m, self.height_m])
        return np.asarray(inside.all(axis=1))


def on_glass(places: Array) -> Array:
    """Points (n, 3) in g [m] of places (n, 2) on the glass."""
    return np.column_stack((np.zeros(len(places)), -places[:, 0], places[:, 1]))


def pierced(eye_in_g: Array, points_in_g: Array) -> Array:
    """Places (n, 2) where an eye must see light on the glass to see it at `points_in_g` (n, 3).

    The off-axis perspective of a window. NaN where there is none: the eye is not before the glass,
    or the point not before the eye.
    """
    ahead = points_in_g[:, 0] - eye_in_g[0]
    is_seen = (ahead > LEAST_AHEAD_M) & (eye_in_g[0] < 0.0)
    share = np.where(is_seen, -eye_in_g[0] / np.where(is_seen, ahead, 1.0), np.nan)
    hits = eye_in_g + share[:, None] * (points_in_g - eye_in_g)
    return np.column_stack((-hits[:, 1], hits[:, 2]))


def seen_through(eye_in_g: Array, rays_in_g: Array) -> Array:
    """Places (n, 2) on the glass that an eye sees in directions (n, 3)."""
    hits = eye_in_g - (eye_in_g[0] / rays_in_g[:, 0])[:, None] * rays_in_g
    return np.column_stack((-hits[:, 1], hits[:, 2]))


@dataclass(frozen=True, slots=True, eq=False)
class Hanging:
    """Where the simulated world is behind the glass: upright, whatever the glass's tilt."""

    R_fg: Array
    """(3, 3)."""
    rest_in_f: Array
    """(3,) what the middle of the glass shows of a robot at rest: the middle of its LEDs [m]."""

    @classmethod
    def of(cls, up_in_g: Array, leds_in_b: Array) -> Hanging:
        """The LEDs (n, 3) hang at the glass, of which `up_in_g` (3,) is the vertical."""
        return cls(R_fc_level_from_specific_force(GRAVITY * up_in_g), leds_in_b.mean(axis=0))

    def leds_in_g(self, R_fb: Array, p_bf_in_f: Array, leds_in_b: Array) -> Array:
        """LEDs (n, 3) of a robot at that pose, in g [m]."""
        return (p_bf_in_f + leds_in_b @ R_fb.T - self.rest_in_f) @ self.R_fg
