"""Image format that a calibration holds for: size, and how the phone was turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hardware.camera_file import find_camera_file
from pipeline.camera.lens import Camera
from server.protocol.wire_records import QUARTERS, Picture

USUAL_FOCAL = 0.78
"""Focal length of a phone's main camera, of the longer side of its film: 65° wide."""


@dataclass(frozen=True, slots=True)
class ImageFormat:
    """Format of one stream's images: with another one it is another camera."""

    width: int
    height: int
    screen_angle_deg: int
    shrunk: int = 0
    """By so many quarters the page has made pictures smaller than the camera's."""

    @classmethod
    def of(cls, picture: Picture) -> ImageFormat:
        """Format of one image."""
        return cls(picture.width, picture.height, picture.screen_angle_deg, picture.shrunk)

    @property
    def taken(self) -> tuple[int, int]:
        """Size of the camera's picture (width, height) [px]."""
        share = QUARTERS / (QUARTERS - self.shrunk)
        return round(share * self.width), round(share * self.height)

    def camera(self, device: str, folders: Sequence[Path]) -> tuple[Path, Camera]:
        """The file that calibrates `device` for such pictures, and the camera that makes them.

        Raises:
            CameraFileError: there is none.
        """
        path, camera = find_camera_file(device, *self.taken, folders, self.screen_angle_deg)
        return path, camera.resized(self.width, self.height)

    def guessed(self) -> Camera:
        """A phone's usual camera, by the size of its pictures alone."""
        focal = USUAL_FOCAL * max(self.width, self.height)
        u, v = 0.5 * (self.width - 1), 0.5 * (self.height - 1)
        K = np.array([[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]])
        return Camera(self.width, self.height, K, "plumb_bob", np.zeros(5))
