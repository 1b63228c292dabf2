"""Does a film show enough for an answer to mean something?"""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array
from server.tools.survey.reconstruction.errors import SurveyError

ADVICE = "walk about the robot, 30° to each side and up and down"
MIRROR_RATIO = 1.5
"""A rival structure whose squares are not larger by this is not refuted."""
MAX_SIGMA = 0.02
"""Of its size, what a shape's worst coordinate may be unsure by."""
MIN_SPREAD_RAD = np.radians(8.0)
"""Of the directions from which the LEDs were seen."""


def check_views(spread_rad: float, rival: float) -> None:
    """Is there parallax at all?

    Args:
        spread_rad: Largest angle between two directions from which the LEDs were seen.
        rival: Squares of the best other shape, as a multiple.

    Raises:
        SurveyError: too little of it.
    """
    if spread_rad < MIN_SPREAD_RAD:
        raise SurveyError(
            f"too little parallax: all views are within {np.degrees(spread_rad):.1f}° of each"
            f" other, {np.degrees(MIN_SPREAD_RAD):.0f}° are the least: {ADVICE}"
        )
    if rival < MIRROR_RATIO:
        raise SurveyError(
            "too little parallax: another shape, as a mirror image, explains the film as well"
            f" ({rival:.2f} times its squares): {ADVICE}, and nearer"
        )


def check_sigma(points: Array, covariance: Array) -> None:
    """Is there enough of it?

    Args:
        points: (n, 3) [m].
        covariance: (3 n, 3 n) [m²].

    Raises:
        SurveyError: a coordinate is known too badly.
    """
    size = float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
    sigma = float(np.sqrt(np.diag(covariance).max()))
    if sigma > MAX_SIGMA * size:
        raise SurveyError(
            f"too little parallax: a coordinate is unsure by {1e3 * sigma:.1f} mm, of LEDs"
            f" {1e3 * size:.0f} mm from their middle: {ADVICE}, and nearer"
        )
