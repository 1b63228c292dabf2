"""How points move over a picture while it is taken, each at the time its row is exposed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.camera.lens import Camera
from pipeline.frames import Array

NODES = 5
"""Times at which places are exact; between them a polynomial, right to 1e-3 px."""
ROW_ITERATIONS = 4
BEYOND = 1.25
"""Half fields to each side outside of which nothing is drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageTrajectories:
    """How points move over the picture around the times at which their rows are exposed."""

    rows: Array
    """(n, 6) place [px], velocity [px/s], acceleration [px/s²]."""
    depth: Array
    """(n,) ahead of the camera [m]; NaN: out of sight."""


def ways_of(
    points_in_c: Callable[[float], Array],
    camera: Camera,
    exposure_s: float,
    beyond: float = BEYOND,
) -> ImageTrajectories:
    """Of points (n, 3) [m], given at times [s] after the middle row's exposure."""
    span = 0.5 * (abs(camera.readout_s) + exposure_s) + 1e-4
    nodes = np.linspace(-1.0, 1.0, NODES)
    points = np.array([points_in_c(span * s) for s in nodes])
    depth = points[NODES // 2, :, 0]
    seen = _ahead(points, camera, beyond)
    safe = np.where(seen[:, None], points, np.array([1.0, 0.0, 0.0]))
    pixels = camera.pixels(safe.reshape(-1, 3)).reshape(NODES, -1)
    powers: Array = np.linalg.inv(np.vander(nodes, increasing=True)).astype(np.float64) @ pixels
    powers = (powers / span ** np.arange(NODES)[:, None]).reshape(NODES, -1, 2)
    return ImageTrajectories(_at_their_rows(powers, camera), np.where(seen, depth, np.nan))


def _ahead(points: Array, camera: Camera, beyond: float) -> npt.NDArray[np.bool_]:
    """(m,) whether points (k, m, 3) in c are near the field of view at all times."""
    x = points[:, :, 0]
    reach = beyond * np.array(camera.half_field)
    inside = np.abs(points[:, :, 1:]) < np.maximum(x, 0.0)[:, :, None] * reach
    return np.asarray((inside.all(axis=2) & (x > 0.1)).all(axis=0))


def _at_their_rows(powers: Array, camera: Camera) -> Array:
    """(n, 6) place, velocity, acceleration when a place's row is exposed.

    `powers` (k, n, 2): coefficients over time [s] from the middle row's exposure.
    """
    orders, last = np.arange(len(powers)), np.array([camera.width, camera.height]) - 1.0
    t = np.zeros(powers.shape[1])
    for _ in range(ROW_ITERATIONS if camera.readout_s != 0.0 else 0):
        pixels = (powers * t[None, :, None] ** orders[:, None, None]).sum(axis=0)
        t = camera.delays(np.clip(pixels, 0.0, last))
    rows = np.zeros((len(t), 6))
    scale = np.ones(len(powers))
    for order in range(3):
        rest = powers[order:] * scale[order:, None, None]
        rows[:, 2 * order : 2 * order + 2] = (
            rest * t[None, :, None] ** np.arange(len(rest))[:, None, None]
        ).sum(axis=0)
        scale = scale * np.maximum(orders - order, 0)
    return rows
