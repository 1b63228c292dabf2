"""Compiled: light falling on a sensor, and what the sensor makes of it."""

from __future__ import annotations

from math import ceil, exp, floor, sqrt

import numpy as np
import numpy.typing as npt

from pipeline.frames import Array
from pipeline.signals import Image
from pipeline.so3_kernels import kernel

Light = npt.NDArray[np.float32]
"""(height, width) linear light; 1 saturates."""
STEP_PX = 0.04
"""Between the entries of a profile."""


@kernel
def spread(
    light: Light,
    box: npt.NDArray[np.int64],
    way: Array,
    row_s: float,
    times: Array,
    profile: Array,
    strength: float,
) -> None:
    """Add a spot of light that moves while it is exposed, row by row.

    Args:
        light: The picture so far.
        box: Left, top, right, bottom; the last two are beyond the end.
        way: (6,) place [px], velocity [px/s] and acceleration [px/s²] when the place's row is
            exposed.
        row_s: How much later each row is exposed than the one above it [s].
        times: (n,) parts of the exposure, from its middle [s].
        profile: (m,) light over the distance from the spot's centre, `STEP_PX` apart.
        strength: Of the light.
    """
    reach = (len(profile) - 2) * STEP_PX
    share = strength / len(times)
    for row in range(box[1], box[3]):
        for time in times:
            t = (row - way[1]) * row_s + time
            cu = way[0] + t * (way[2] + 0.5 * t * way[4])
            cv = way[1] + t * (way[3] + 0.5 * t * way[5])
            dv = row - cv
            if abs(dv) >= reach:
                continue
            half = sqrt(reach * reach - dv * dv)
            for column in range(max(box[0], ceil(cu - half)), min(box[2], floor(cu + half) + 1)):
                at = sqrt((column - cu) ** 2 + dv * dv) / STEP_PX
                k = int(at)
                light[row, column] += share * (
                    profile[k] + (at - k) * (profile[k + 1] - profile[k])
                )


@kernel
def glow(
    light: Light, box: npt.NDArray[np.int64], u: float, v: float, sigma_px: float, strength: float
) -> None:
    """Add a Gaussian skirt about (u, v) [px]; a box that ends where it is faint."""
    scale = -0.5 / (sigma_px * sigma_px)
    for row in range(box[1], box[3]):
        of_row = strength * exp(scale * (row - v) ** 2)
        for column in range(box[0], box[2]):
            light[row, column] += of_row * exp(scale * (column - u) ** 2)


@kernel
def expose(
    light: Light,
    box: npt.NDArray[np.int64],
    shot: float,
    read: float,
    noise: Light,
    du: int,
    dv: int,
    grey: Image,
    picture: Image,
) -> None:
    """Noise, clipping, gamma, rounding, in this order, within a box.

    Args:
        light: Linear light.
        box: Left, top, right, bottom.
        shot: Variance of the light per light: one over the electrons that saturate.
        read: Standard deviation of the noise in the dark.
        noise: Bank of unit Gaussian noise; this picture's begins at row `dv`, column `du`.
        du: Column.
        dv: Row.
        grey: Grey level of each light, from 0 to 1.
        picture: Written.
    """
    top = len(grey) - 1
    for row in range(box[1], box[3]):
        for column in range(box[0], box[2]):
            x = light[row, column]
            x += sqrt(x * shot + read * read) * noise[row + dv, column + du]
            picture[row, column] = grey[int(min(max(x, 0.0), 1.0) * top + 0.5)]
