"""Lens of a phone without a calibration, from the fiducials of a glass (Zhang 2000, Sec. 3).

The middle of the picture is taken for the lens's: where it is 10 pixels beside, the focal length
found is some 4 % wrong, which a robot of light bears (`SimpleLens` is 20 % wrong at times).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final

import cv2
import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from pipeline.frames import Array
from pipeline.glass.window import Glass

EVERY_S: Final = 0.1
"""Nearer pictures say the same."""
VIEWS: Final = 20
"""Of a phone that is tilted against the glass, enough; of another one ..."""
KEPT: Final = 40
"""... the newest are looked at, until it is."""
AGAIN: Final = 5
"""Views until another trial of a phone that was not tilted: one takes 30 ms."""
LEAST_CORNERS: Final = 12
"""Of sixteen: three markers."""
LEAST_TILT: Final = radians(5.0)
"""A glass seen at right angles looks the same through any lens."""
SURE: Final = 0.007
"""Standard deviation of the focal length, as a share of it."""
SHORTEST: Final = 0.35
LONGEST: Final = 2.0
"""Of phones' lenses, of the longer side: what is found beyond is another minimum's."""
MOST_RMS_PX: Final = 1.5
"""What fits worse has moved too fast, or is not such a lens."""
FLAGS: Final = (
    cv2.CALIB_USE_INTRINSIC_GUESS
    | cv2.CALIB_FIX_PRINCIPAL_POINT
    | cv2.CALIB_FIX_ASPECT_RATIO
    | cv2.CALIB_ZERO_TANGENT_DIST
    | cv2.CALIB_FIX_K2
    | cv2.CALIB_FIX_K3
)
TILT = "Tilt the phone a little: its lens is being measured."


@dataclass(frozen=True, slots=True, eq=False)
class GlassCorners:
    """Corners of the fiducials in one picture."""

    t: float
    """When its middle row was taken [s]."""
    numbers: Array
    """(n,) as in `Glass.fiducials`."""
    pixels: Array
    """(n, 2)."""


class LensMeter:
    """One phone's camera before one glass: pictures of it in, the lens out, once."""

    def __init__(self, camera: Camera, glass: Glass) -> None:
        """Nothing is known of `camera` but the size of its pictures."""
        self.camera = camera
        fiducials = glass.fiducials()
        self._on_glass = np.column_stack((-fiducials[:, 1:], np.zeros(len(fiducials))))
        self._views: list[GlassCorners] = []
        self._wanted = VIEWS
        self.lens: SimpleLens | None = None
        """Once it is measured."""

    def add_corners(self, corners: GlassCorners) -> None:
        """Take what a picture shows, and measure when enough have come."""
        is_near = bool(self._views) and corners.t < self._views[-1].t + EVERY_S
        if self.lens is not None or is_near or len(corners.numbers) < LEAST_CORNERS:
            return
        self._views = [*self._views[1 - KEPT :], corners]
        self._wanted -= 1
        if self._wanted <= 0:
            self._wanted = AGAIN
            self.lens = self._measured()

    def _measured(self) -> SimpleLens | None:
        size = self.camera.width, self.camera.height
        rms_px, K, distortion, turns, _, sigmas, _, _ = cv2.calibrateCameraExtended(
            [self._on_glass[view.numbers].astype(np.float32) for view in self._views],
            [view.pixels.astype(np.float32) for view in self._views],
            size,
            SimpleLens().camera(*size).K,
            np.zeros(5),
            flags=FLAGS,
        )
        focal, sigma = float(K[1, 1]) / max(size), float(sigmas[1, 0] / K[1, 1])
        ahead = np.array([abs(cv2.Rodrigues(turn)[0][2, 2]) for turn in turns])
        is_tilted = float(np.median(np.arccos(np.minimum(ahead, 1.0)))) > LEAST_TILT
        is_lens = SHORTEST < focal < LONGEST and rms_px < MOST_RMS_PX
        if not is_lens or not is_tilted or not sigma < SURE:
            return None
        return SimpleLens(focal, float(np.ravel(distortion)[0]))
