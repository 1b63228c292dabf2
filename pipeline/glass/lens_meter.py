"""Lens of a phone, from the fiducials of a glass: new, or beside its file (Zhang 2000, Sec. 3).

Of a phone without a calibration the middle of the picture is taken for the lens's: where it is 10
pixels beside, the focal length found is some 4 % wrong, which a robot of light bears (`SimpleLens`
is 20 % wrong at times).
"""

from __future__ import annotations

from collections.abc import Sequence
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
SPREAD_S: Final = 0.5
"""A focal length that is to be checked has a minute: of more turns of the phone."""
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
ALONE: Final = FLAGS | cv2.CALIB_FIX_K1
"""All but the focal length is as it is known."""
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


@dataclass(frozen=True, slots=True)
class FocalError:
    """How a focal length differs from the calibrated one, by a glass."""

    value: float
    """Things look larger by this share."""
    sigma: float


class GlassViews:
    """The newest views of one glass through one camera that show enough of it; replaced whole."""

    def __init__(self, camera: Camera, glass: Glass, every_s: float = EVERY_S) -> None:
        """None yet; each is to be so much younger than the one before."""
        self.camera, self._every_s = camera, every_s
        fiducials = glass.fiducials()
        self._on_glass = np.column_stack((-fiducials[:, 1:], np.zeros(len(fiducials))))
        self.kept: tuple[GlassCorners, ...] = ()

    def add(self, corners: GlassCorners) -> bool:
        """Keep a view, unless it says hardly more than the last one; tells whether."""
        is_near = bool(self.kept) and corners.t < self.kept[-1].t + self._every_s
        if is_near or len(corners.numbers) < LEAST_CORNERS:
            return False
        self.kept = (*self.kept[1 - KEPT :], corners)
        return True

    def focal_error(self) -> FocalError | None:
        """By how much the camera's focal length is wrong; None while nobody can say.

        What size the glass is told to have does not matter: a larger one would only be farther.
        """
        views, camera = self.kept, self.camera
        if len(views) < VIEWS:
            return None
        middle = np.array([0.5 * (camera.width - 1), 0.5 * (camera.height - 1)])
        K = np.array([[camera.focal_px, 0, middle[0]], [0, camera.focal_px, middle[1]], [0, 0, 1]])
        flat = [camera.focal_px * camera.normalised(view.pixels) + middle for view in views]
        found = self._fitted(views, flat, K, ALONE)
        if found is None:
            return None
        K_found, _, sigma = found
        return FocalError(float(K_found[1, 1]) / camera.focal_px - 1.0, sigma)

    def lens(self) -> SimpleLens | None:
        """The lens, if nothing is known but the size of its pictures; None while nobody can say."""
        size = self.camera.width, self.camera.height
        pixels = [view.pixels for view in self.kept]
        found = self._fitted(self.kept, pixels, SimpleLens().camera(*size).K, FLAGS)
        if found is None:
            return None
        K, distortion, _ = found
        focal = float(K[1, 1]) / max(size)
        is_lens = SHORTEST < focal < LONGEST
        return SimpleLens(focal, float(distortion[0])) if is_lens else None

    def _fitted(
        self, views: Sequence[GlassCorners], pixels: Sequence[Array], K: Array, flags: int
    ) -> tuple[Array, Array, float] | None:
        """(K, distortion, σ of the focal length as a share); None if views don't tell, or misfit.

        Args:
            views: For what they show.
            pixels: Where they show it, (n, 2) each.
            K: To begin with (3, 3).
            flags: Of OpenCV: what is left as it is.
        """
        rms_px, K_found, distortion, turns, _, sigmas, _, _ = cv2.calibrateCameraExtended(
            [self._on_glass[view.numbers].astype(np.float32) for view in views],
            [one.astype(np.float32) for one in pixels],
            (self.camera.width, self.camera.height),
            K,
            np.zeros(5),
            flags=flags,
        )
        sigma = float(sigmas[1, 0] / K_found[1, 1])
        ahead = np.array([abs(cv2.Rodrigues(turn)[0][2, 2]) for turn in turns])
        is_tilted = float(np.median(np.arccos(np.minimum(ahead, 1.0)))) > LEAST_TILT
        is_told = rms_px < MOST_RMS_PX and is_tilted and sigma < SURE
        return (np.asarray(K_found), np.ravel(distortion), sigma) if is_told else None


class LensMeter:
    """One phone's camera before one glass: pictures of it in, the lens out, once."""

    def __init__(self, camera: Camera, glass: Glass) -> None:
        """Nothing is known of `camera` but the size of its pictures."""
        self.camera = camera
        self._views = GlassViews(camera, glass)
        self._wanted = VIEWS
        self.lens: SimpleLens | None = None
        """Once it is measured."""

    def add_corners(self, corners: GlassCorners) -> None:
        """Take what a picture shows, and measure when enough have come."""
        if self.lens is not None or not self._views.add(corners):
            return
        self._wanted -= 1
        if self._wanted <= 0:
            self._wanted = AGAIN
            self.lens = self._views.lens()
