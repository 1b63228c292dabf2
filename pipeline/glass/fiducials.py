"""Picture → the glass's fiducials, and the pose that they give."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.glass.window import MARKER_IDS, Glass
from pipeline.identification import pnp
from pipeline.signals import Image, Match, Spots, VisionMeasurement
from pipeline.vision.rays import rays_of

CORNER_PX = 0.15
"""Standard deviation of a corner's place, each way: measured on rendered glass through H.264."""
LEAST_MARKERS = 2
"""One alone has two poses that fit about equally."""
REACH = 0.75
"""How far a marker may have moved since the last picture, of its own size."""
LEAST_SHARE, LEAST_SHARE_NEAR = 0.06, 0.8
"""Circumference of a marker, of the side of a picture, or of a part cut out about one: what is
smaller is noise, and costs time."""
LEAST_PART_PX = 16
MOST_RMS_PX = 2.0
"""A pose that fits worse is another thing's, or another camera's."""


class FiducialDetector:
    """Finds the glass in pictures: where it was, as long as it is there. Keeps OpenCV's tables."""

    def __init__(self) -> None:
        """Of the one family that glasses have."""
        self._anywhere, self._near = _detector(LEAST_SHARE), _detector(LEAST_SHARE_NEAR)
        self._last: dict[int, Array] = {}
        """Corners (4, 2) of the markers in the last picture."""

    def find(self, luma: Image) -> tuple[Array, Array]:
        """Numbers (n,) and pixels (n, 2) of the corners in a picture, as `Glass.fiducials`."""
        found: dict[int, Array] = {}
        for corners in self._last.values():
            reach = REACH * np.ptp(corners, axis=0).max()
            left, top = np.maximum(corners.min(axis=0) - reach, 0.0).astype(int)
            right, bottom = np.ceil(corners.max(axis=0) + reach).astype(int)
            part = luma[top:bottom, left:right]
            if min(part.shape) > LEAST_PART_PX:
                here = _found(self._near, part)
                found |= {k: at + np.array([left, top]) for k, at in here.items()}
        if len(found) < len(MARKER_IDS):
            found = _found(self._anywhere, luma)
        self._last = found
        numbers = [4 * k + i for k in found for i in range(4)]
        places = np.array([p for at in found.values() for p in at], dtype=np.float64)
        return np.array(numbers, dtype=np.intp), places.reshape(-1, 2)


def _detector(least_share: float) -> cv2.aruco.ArucoDetector:
    """Of markers whose circumference has at least such a share of the picture's longer side."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin = 7
    parameters.adaptiveThreshWinSizeMax = 43
    parameters.adaptiveThreshWinSizeStep = 18
    parameters.adaptiveThreshConstant = 4.0  # they are dim, or they would outshine the LEDs
    parameters.minMarkerPerimeterRate = least_share
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    return cv2.aruco.ArucoDetector(dictionary, parameters)


def _found(detector: cv2.aruco.ArucoDetector, luma: Image) -> dict[int, Array]:
    """Corners (4, 2) of the markers in a picture or a part of it."""
    found: Any
    ids: Any
    found, ids, _ = detector.detectMarkers(np.ascontiguousarray(luma))
    pairs = zip(() if ids is None else np.ravel(ids).tolist(), found, strict=True)
    return {
        MARKER_IDS.index(name): np.asarray(at, dtype=np.float64).reshape(4, 2)
        for name, at in pairs
        if name in MARKER_IDS
    }


def glass_seen(
    camera: Camera, glass: Glass, numbers: Array, pixels: Array, t: float
) -> VisionMeasurement | None:
    """What a picture taken at `t` [s] says of the glass; None: too little, or no glass."""
    n = len(numbers)
    if n < 4 * LEAST_MARKERS:
        return None
    spots = Spots(pixels, np.tile(CORNER_PX**2 * np.eye(2), (n, 1, 1)), np.ones(n), np.ones(n))
    match = Match(numbers.astype(np.intp), np.arange(n))
    fit = pnp.solve(camera, glass.fiducials(), spots, match)
    if fit is None or fit.rms_px > MOST_RMS_PX:
        return None
    rays = rays_of(camera, spots, match, t)
    return VisionMeasurement(t, rays, pnp.pose_of(fit, t), camera.half_field)
