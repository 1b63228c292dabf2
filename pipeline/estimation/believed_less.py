"""A picture of which less is believed: that all its LEDs are off together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.frames import Array
from pipeline.signals import LedRays, RelativePose

NO_TURN = np.zeros(3)


def widened(
    pose: RelativePose,
    rays: LedRays,
    leds_in_b: Array,
    beside: Array,
    turned_in_b: Array = NO_TURN,
) -> tuple[RelativePose, LedRays]:
    """The same, less sure: all LEDs may be wrong together.

    Args:
        pose: Of the picture, ...
        rays: ... and what it says of each LED.
        leds_in_b: (n, 3) [m].
        beside: By how much (3,) in c [m], ...
        turned_in_b: ... and by what turn (3,) [rad].
    """
    arms = leds_in_b[rays.led]
    q = pose.p_bc_in_c + arms @ pose.R_cb.T
    moved = beside + np.cross(turned_in_b, arms) @ pose.R_cb.T
    off = (moved[:, 1:] - rays.tangents * moved[:, :1]) / q[:, :1]
    shared = len(rays) * off[:, :, None] * off[:, None, :]
    both = np.concatenate((beside, turned_in_b))
    return (
        replace(pose, covariance=pose.covariance + np.outer(both, both)),
        replace(rays, covariances=rays.covariances + shared),
    )
