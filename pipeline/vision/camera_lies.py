"""Lies that a camera tells of itself: which one it is, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log, sqrt
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.signals import VisionMeasurement
from pipeline.vision.repeated_frames import STANDS

ACROSS_RAD, ACROSS_SHARE, ACROSS_S = 0.001, 0.05, 0.003
"""Beside its place by less a robot may be: a pixel, 2.5 mm at 2.5 m; a share of the phone's turning
meanwhile, for a camera that sits 3° beside where its calibration says; what it turns in a time by
which stamps may be wrong."""
ALONG: Final = 0.008
"""Nearer or farther than predicted by less than this share it may be."""
STILL: Final = 3e-4
"""Tangents that change less while the robot should pass show an old picture."""
SHIFTED = (
    "The picture does not move as the phone turns: switch off video stabilisation, or use another "
    "lens or browser; if pictures come late, reload the page."
)
SCALED = (
    "The picture became {percent:.0f} % {larger} though nothing came nearer or went away: set the "
    "zoom back to 1×, take the lens as before, fix the focus if the phone can."
)
BACK: Final = "The picture has its old size again: move the phone a little, to show it."


@dataclass(frozen=True, slots=True)
class CameraLie:
    """One that was noticed."""

    words: str
    """For who holds the phone."""
    scale: float = 0.0
    """Log of how much larger the picture became."""


def is_far(off: Array, p: Array, turned: float, rate: float) -> bool:
    """Whether a place `off` (3,) beside where it was predicted, p (3,) [m], is no small error.

    The phone `turned` so far meanwhile [rad], to and fro at a `rate` [rad/s].
    """
    across, along = _parts(off, p)
    allowed = ACROSS_RAD + ACROSS_SHARE * turned + ACROSS_S * rate
    return across > allowed or abs(along) > ALONG


def named(shown: Sequence[VisionMeasurement], off: Array, p: Array) -> CameraLie:
    """The lie of pictures in a row, the last one `off` (3,) beside p (3,) [m].

    The first of them was still believed: one that stands shows it again.
    """
    if _stands(shown):
        return CameraLie(STANDS)
    across, along = _parts(off, p)
    if across / ACROSS_RAD > abs(along) / ALONG:
        return CameraLie(SHIFTED)
    scale = -log(max(1.0 + along, 0.1))
    return CameraLie(scaled(scale), scale)


def scaled(scale: float) -> str:
    """A picture that became larger by exp(`scale`)."""
    larger = "larger" if scale > 0.0 else "smaller"
    return SCALED.format(percent=100.0 * abs(exp(scale) - 1.0), larger=larger)


def _stands(shown: Sequence[VisionMeasurement]) -> bool:
    """All show what the first one shows."""
    first = shown[0].rays
    return all(
        np.array_equal(one.rays.led, first.led)
        and float(np.abs(one.rays.tangents - first.tangents).max(initial=0.0)) < STILL
        for one in shown
    )


def _parts(off: Array, p: Array) -> tuple[float, float]:
    """Across the optical axis, as seen from the camera [rad], and along it, as a share of p."""
    return sqrt(float(off[1:] @ off[1:])) / float(p[0]), float(off[0] / p[0])
