"""A picture of which less is believed: that all its LEDs are off together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.frames import Array, skew
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
    both = np.concatenate((beside, turned_in_b))
    return (
        replace(pose, covariance=pose.covariance + np.outer(both, both)),
        widened_rays(pose.p_bc_in_c, pose.R_cb, rays, leds_in_b, beside, turned_in_b),
    )


def widened_rays(
    p_bc_in_c: Array,
    R_cb: Array,
    rays: LedRays,
    leds_in_b: Array,
    beside: Array,
    turned_in_b: Array = NO_TURN,
) -> LedRays:
    """The same of the rays alone, of a robot at `p_bc_in_c` (3,) [m] and R_cb (3, 3)."""
    arms = leds_in_b[rays.led]
    q = p_bc_in_c + arms @ R_cb.T
    moved = beside + arms @ (R_cb @ skew(turned_in_b)).T
    off = (moved[:, 1:] - rays.tangents * moved[:, :1]) / q[:, :1]
    shared = len(rays) * off[:, :, None] * off[:, None, :]
    return replace(rays, covariances=rays.covariances + shared)
