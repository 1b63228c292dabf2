"""The paper's filter on the time axis of `out_of_sequence`: each pose and sample at its moment."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import Final

import numpy as np

from pipeline.estimation.out_of_sequence import Checkpoint, OutOfSequence
from pipeline.estimation.paper_ekf_kernels import MOVING, N, workspace
from pipeline.estimation.paper_ekf_replay import FAILED, fuse_pose, replay
from pipeline.estimator_config import EkfConfig
from pipeline.frames import Array
from pipeline.signals import Flags

KEPT: Final = 0
"""Samples up to the base that still matter."""
BENT: Final = 1
"""A sample is fused at its time: nothing changes up to the one before it."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A measured (p, η)."""

    t: float
    y: Array
    """(6,) [m, rad]."""
    C: Array
    """(6, 6) its covariance."""


class PaperTrack(OutOfSequence[PoseMeasurement]):
    """State x (30,) and covariance P (30, 30) of `relative_model` at any time since the base.

    What can't be believed any more has no number in x.
    """

    def __init__(self, config: EkfConfig) -> None:
        """Take the noise as configured."""
        super().__init__(N, N, MOVING, BENT, KEPT)
        self._walk, self._r = walk_densities(config), imu_variances(config)
        self._steps = np.array([config.max_step_s, config.tau_delta_c])
        self._gate, self._work = config.gate_chi2, workspace()

    def _fuse(self, here: Checkpoint[PoseMeasurement], seen: PoseMeasurement, use: Flags) -> float:
        if use[0] == 0:
            return nan
        gate = self._gate if use[0] < 0 else inf
        chi2 = float(fuse_pose(here.x, here.P, seen.y, seen.C, gate, self._work))
        use[0] = chi2 <= gate
        return chi2

    def _is_sound(self, here: Checkpoint[PoseMeasurement]) -> bool:
        return isfinite(here.x[0])

    def _advance(self, here: Checkpoint[PoseMeasurement], t: float) -> None:
        body, phone = self.body, self.phone
        used = replay(
            here.x,
            here.P,
            here.R_ic,
            (here.t, t),
            body.times,
            body.values,
            phone.times,
            phone.values,
            self._r,
            self._walk,
            self._steps,
            self._work,
        )
        if used == FAILED:
            here.x[:] = nan
        here.t = t


def walk_densities(c: EkfConfig) -> Array:
    """(30,) density of the process noise [unit²/s]."""
    per_state = (0.0, 0.0, c.walk_v, c.walk_omega_b, 0.0, c.walk_a_b, c.walk_a_c, c.walk_delta_c)
    return np.repeat(np.square((*per_state, c.walk_bias_omega, c.walk_bias_a)), 3)


def imu_variances(c: EkfConfig) -> Array:
    """(2, 6) by kind."""
    body, phone = (c.sigma_omega_b, c.sigma_a_b), (c.sigma_omega_c, c.sigma_a_c)
    return np.repeat(np.square((body, phone)), 3, axis=1)


def initial_variances(c: EkfConfig) -> Array:
    """(30,) at a start; those of the pose come with it."""
    rate, force = c.initial_omega, c.initial_a
    sigmas = (0.0, 0.0, c.initial_v, rate, rate, force, force, c.initial_delta)
    return np.repeat(np.square((*sigmas, c.initial_bias_omega, c.initial_bias_a)), 3)
