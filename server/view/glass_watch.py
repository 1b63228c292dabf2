"""Looks for the glass of a robot of light in the pictures of a phone."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.camera.lens import Camera, points_of
from pipeline.frames import Array
from pipeline.glass.fiducials import FiducialDetector, glass_seen
from pipeline.glass.lens_meter import GlassCorners
from pipeline.glass.window import Glass
from pipeline.signals import Image, VisionMeasurement
from pipeline.vision.detection import Detection

DOUBT_PICTURES = 15
"""Without a glass every so many pictures one is asked why."""
BRIGHT = 0.45
"""Of white: the middle of all grey levels of a picture in which no dim thing stands out."""


@dataclass(frozen=True, slots=True, eq=False)
class GlassLook:
    """What one picture says of the glass."""

    seen: VisionMeasurement | None
    lights_in_c: Array
    """(n, 3) directions of lights, brightest first."""
    corners: GlassCorners
    why: str = ""
    """There is no glass, and this may be the reason, in words."""


class GlassWatch:
    """One camera that films one glass."""

    def __init__(self, camera: Camera, glass: Glass) -> None:
        """Keeps the tables of the detector."""
        self._camera, self._glass = camera, glass
        self._fiducials = FiducialDetector()
        self._without = 0

    def look(self, luma: Image, detection: Detection) -> GlassLook:
        """Look at a picture in which the LEDs were looked for already."""
        numbers, pixels = self._fiducials.find(luma)
        seen = glass_seen(self._camera, self._glass, numbers, pixels, detection.t)
        order = np.argsort(-detection.spots.brightness, kind="stable")
        lights = points_of(self._camera.normalised(detection.spots.pixels[order]))
        corners = GlassCorners(detection.t, numbers, pixels)
        if seen is not None:
            self._without = 0
            return GlassLook(seen, lights, corners)
        self._without += 1
        is_asked = self._without % DOUBT_PICTURES == 0
        return GlassLook(None, lights, corners, self._why(luma) if is_asked else "")

    def _why(self, luma: Image) -> str:
        small = luma[::4, ::4]
        if float(np.median(small)) > BRIGHT * 255.0:
            return "The picture is too bright: dim the room, and turn no lamp on the screen."
        mirrored, _ = self._fiducials.find(np.ascontiguousarray(cv2.flip(luma, 1)))
        return "The picture is mirrored: switch that off." if len(mirrored) else ""
