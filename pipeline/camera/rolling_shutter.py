"""Rolling shutter: spots carried to where they would be if all rows were exposed at once."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.camera.lens import Camera, points_of
from pipeline.frames import Array, skew
from pipeline.signals import Spots

FILTERED_M_S = 0.02
"""How well a filter with both motion sensors knows a velocity, in each axis: 9 to 18 mm/s in
simulated flights, 30 by restless hands."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameMotion:
    """How the robot's place in c changes."""

    omega_cf_in_c: Array
    """(3,) [rad/s]."""
    u_bf_in_c: Array
    """(3,) [m/s]: velocity of the body seen from f."""
    depth_m: float
    """How far ahead the robot is; infinite if unknown: then only the camera's turning counts."""
    omega_bf_in_b: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) [rad/s]: of no use before the spots have names."""
    sigma_u: float = FILTERED_M_S
    """How well an LED's velocity in c is known by all this, in each axis [m/s]."""


def unrolled(camera: Camera, spots: Spots, motion: FrameMotion | None) -> Spots:
    """The spots as of the middle line's exposure; unchanged without rolling shutter or motion."""
    if camera.readout_s == 0.0 or motion is None or len(spots) == 0:
        return spots
    rays = points_of(camera.normalised(spots.pixels))  # q / q_x
    # q̇ = u − ω × q, by q_x
    rates = motion.u_bf_in_c / motion.depth_m - rays @ skew(motion.omega_cf_in_c).T
    flow = rates - rays * rates[:, :1]
    delays = camera.delays(spots.pixels)
    return replace(spots, pixels=camera.pixels(rays - flow * delays[:, None]))
