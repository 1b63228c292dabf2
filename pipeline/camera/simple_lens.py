"""A phone's camera without a calibration: its focal length, and how much its picture bulges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.camera.lens import Camera


@dataclass(frozen=True, slots=True)
class SimpleLens:
    """What differs most between phones; the middle of the picture is taken for the lens's.

    The defaults are a phone's usual main camera, 65° wide; others are 10 % beside, and with a
    stabiliser's crop 20 %.
    """

    focal: float = 0.78
    """Of the longer side of the picture."""
    k1: float = 0.0
    """First radial coefficient of `plumb_bob`."""
    readout_s: float = 0.015
    """Of the rolling shutter: 8 to 25 ms in video."""

    def camera(self, width: int, height: int) -> Camera:
        """The camera that makes pictures of that size [px], upright or not."""
        focal = self.focal * max(width, height)
        u, v = 0.5 * (width - 1), 0.5 * (height - 1)
        K = np.array([[focal, 0.0, u], [0.0, focal, v], [0.0, 0.0, 1.0]])
        k = np.array([self.k1, 0.0, 0.0, 0.0, 0.0])
        return Camera(width, height, K, "plumb_bob", k, readout_s=self.readout_s)
