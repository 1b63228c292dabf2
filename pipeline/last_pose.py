"""The last believed pose of a camera's robot, and what it predicts for the next picture."""

from __future__ import annotations

import numpy as np

from pipeline.expected import Expected
from pipeline.frames import Array, exp, log
from pipeline.signals import RelativePose

FORGET_MISSES = 3
MAX_STEP_S = 0.5
"""Longer between pictures: the last pose predicts nothing."""
CONTRADICTION_SIGMAS, CONTRADICTION_M, CONTRADICTION_RAD = 5.0, 0.03, 0.05
"""A believed pose farther than this from where a filter expected it: the filter is wrong."""

Place = tuple[Array, Array]
"""p_bc_in_c (3,) [m] and R_cb (3, 3)."""


class LastPose:
    """Kept from picture to picture, forgotten after three in a row without a pose."""

    def __init__(self) -> None:
        """Nothing seen yet."""
        self._pose: RelativePose | None = None
        self.rate_in_c = np.zeros(3)
        """Of p_bc_in_c between the last two poses [m/s]."""
        self._misses = 0
        self.contradicts = False
        """It was not where a filter expected it: until they agree, the filter is not asked."""

    def keep(self, pose: RelativePose, expected: Expected | None) -> None:
        """`pose` was believed, where a filter had `expected` the robot."""
        last = self._pose
        if last is not None and 0.0 < pose.t - last.t < MAX_STEP_S:
            self.rate_in_c = (pose.p_bc_in_c - last.p_bc_in_c) / (pose.t - last.t)
        else:
            self.rate_in_c = np.zeros(3)
        self._pose, self._misses = pose, 0
        self.contradicts = expected is not None and _contradict(pose, expected)

    def forget(self) -> None:
        """Predict nothing."""
        self._pose, self._misses = None, 0

    def miss(self) -> None:
        """A picture gave nothing."""
        self._misses += 1
        if self._misses >= FORGET_MISSES:
            self.forget()

    def predicted(
        self, t: float, omega_cf_in_c: Array | None, omega_bf_in_b: Array | None
    ) -> Place | None:
        """Moved on to `t` by both gyroscopes and the last velocity."""
        last = self._pose
        if last is None or not 0.0 < t - last.t < MAX_STEP_S:
            return None
        dt = t - last.t
        R_cb = last.R_cb
        if omega_cf_in_c is not None and omega_bf_in_b is not None:
            R_cb = exp(-omega_cf_in_c * dt) @ R_cb @ exp(omega_bf_in_b * dt)
        return last.p_bc_in_c + min(dt, 0.1) * self.rate_in_c, R_cb


def _contradict(pose: RelativePose, expected: Expected) -> bool:
    """Whether not both can be true."""
    shift, turn = pose.p_bc_in_c - expected.p_bc_in_c, log(expected.R_cb.T @ pose.R_cb)
    sigma_p = np.hypot(expected.sigma_p, _largest(pose.covariance[:3, :3]))
    sigma_theta = np.hypot(expected.sigma_theta, _largest(pose.covariance[3:, 3:]))
    far_m = CONTRADICTION_SIGMAS * sigma_p + CONTRADICTION_M
    far_rad = CONTRADICTION_SIGMAS * sigma_theta + CONTRADICTION_RAD
    return not (shift @ shift < far_m**2 and turn @ turn < far_rad**2)


def _largest(covariance: Array) -> float:
    """Standard deviation along the axis that is known worst."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
