"""Image format that a calibration holds for: size, and how the phone was turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hardware.camera_file import find_camera_file
from pipeline.camera.lens import Camera
from pipeline.camera.simple_lens import SimpleLens
from server.protocol.wire_records import QUARTERS, Picture


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

    def guessed(self, lens: SimpleLens) -> Camera:
        """The camera of a phone without a calibration, whose lens is guessed or was measured.

        Its lines are read from the upper one down while the phone lies on its right side.
        """
        long, short = max(self.width, self.height), min(self.width, self.height)
        is_phone = (self.width > self.height) == (self.screen_angle_deg % 180 == 90)
        upright_deg = 90 if is_phone else 0
        camera = lens.camera(long, short)
        return camera.turned((upright_deg - self.screen_angle_deg) // 90)
