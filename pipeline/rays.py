"""Named spots → tangents in the camera's axes, each with its covariance and its row's time."""

from __future__ import annotations

import numpy as np

from pipeline.camera import Camera
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
    slopes = camera.slopes(pixels)
    covariances = scale * slopes @ spots.covariances[match.spot] @ slopes.transpose(0, 2, 1)
    return LedRays(
        led=match.led,
        t=t + camera.row_delays(pixels[:, 1]),
        tangents=-camera.normalised(pixels),  # right, down → left, up
        covariances=0.5 * (covariances + covariances.transpose(0, 2, 1)),
    )
