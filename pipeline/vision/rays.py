"""Named spots → tangents in the camera's axes, each with its covariance and its row's time."""

from __future__ import annotations

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.lens_kernels import put_tangents
from pipeline.signals import LedRays, Match, Spots

NO_RAYS = LedRays(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)))


def rays_of(camera: Camera, spots: Spots, match: Match, t: float, scale: float = 1.0) -> LedRays:
    """What a filter may use of a picture.

    Args:
        camera: Its lens is taken out, its rolling shutter dates the rows.
        spots: As they stand in the picture.
        match: Their names.
        t: Capture time of the picture's middle row [s].
        scale: By how much the spots' covariances are too small.
    """
    pixels = spots.pixels[match.spot]
    tangents, claimed = np.empty((len(pixels), 2)), np.empty((len(pixels), 2, 2))
    put_tangents(camera.lens, pixels, spots.covariances[match.spot], scale, tangents, claimed)
    return LedRays(match.led, t + camera.delays(pixels), tangents, claimed)
