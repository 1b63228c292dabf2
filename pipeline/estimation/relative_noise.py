"""The relative filter's configured noise, as its kernels take it."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Array

DRIFT_V: Final = 1.0
"""How fast the truth leaves a velocity that is held [m/s²]: of robots that say theirs."""


def noise_of(c: RelativeConfig) -> Array:
    """Noise densities (2, 4, 3) of both sides' samples, as `relative_kernels.transit` takes them.

    Of a velocity: what its samples don't say of themselves.
    """
    body = (
        (c.sigma_omega_b, c.sigma_f_b, 0.0),
        (0.0, c.rough_f_b, 0.0),
        (c.drift_omega_b, c.drift_f_b, DRIFT_V),
    )
    phone = (
        (c.sigma_omega_c, c.sigma_f_c, 0.0),
        (0.0, c.rough_f_c, 0.0),
        (c.drift_omega_c, c.drift_f_c, 0.0),
    )
    unknown = (np.inf, np.inf, np.inf)
    return np.array(((*body, unknown), (*phone, unknown)))


def walks_of(c: RelativeConfig) -> Array:
    """Process noise: densities (13,) of the biases' and the offset's random walks [unit²/s]."""
    walks = (c.walk_omega_b, c.walk_f_b, c.walk_omega_c, c.walk_f_c)
    densities: Array = np.square(np.append(np.repeat(walks, 3), c.walk_offset))
    return densities


def initial_biases(c: RelativeConfig) -> Array:
    """Standard deviations (4,) of the biases at a start, in the order of the inputs."""
    return np.array((c.initial_omega_b, c.initial_f_b, c.initial_omega_c, c.initial_f_c))
