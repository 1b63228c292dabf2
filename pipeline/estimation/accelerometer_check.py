"""An accelerometer whose gravity jumps: turned round, its axes changed, or its phone falls.

No hand and no robot accelerates by most of gravity for long: shaken, pushed or in a collision the
mean over a fifth of a second stays what gravity is. So that mean, turned by the gyroscope, is held
against the mean over ten seconds. A bias step is smaller, and for the filters (`bias_steps`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.estimation.sanity import is_imu_sample
from pipeline.frames import Array
from pipeline.so3_kernels import kernel, put_exp, turn

MEANS_S: Final = (0.2, 10.0)
"""Time constants of the two means."""
MOST: Final = 8.0
"""Their largest difference [m/s²]: a phone shaken to its full scale has 5, a hand at work 1."""
GAP_S: Final = 0.2
"""After a longer one the body may have turned any way."""
KNOWN_S: Final = 1.0
"""Before, the long mean is none."""


class AccelerometerCheck:
    """One IMU's; feed it each sample."""

    def __init__(self) -> None:
        """No samples yet."""
        self._means: Array = np.zeros((2, 3))
        self._sample, self._scratch = np.empty((2, 3)), np.empty((4, 3))
        self._t = self._t_begun = -np.inf

    def add(self, t: float, omega: Array, specific_force: Array) -> None:
        """Take a sample of `t` [s]: `omega` (3,) [rad/s], `specific_force` (3,) [m/s²]."""
        dt = t - self._t
        if dt <= 0.0 or not is_imu_sample(t, omega, specific_force):
            return
        self._t = t
        if dt > GAP_S:
            self._t_begun = t
            self._means[:] = specific_force
            return
        # into an array of its own: one kernel, whatever memory the samples come in
        self._sample[0], self._sample[1] = omega, specific_force
        update_means(self._means, self._sample, dt, t - self._t_begun, self._scratch)

    @property
    def has_jumped(self) -> bool:
        """Whether gravity is measured elsewhere than before."""
        off = self._means[0] - self._means[1]
        is_known = self._t - self._t_begun > KNOWN_S
        return is_known and float(off @ off) > MOST * MOST


@kernel
def update_means(means: Array, sample: Array, dt: float, elapsed_s: float, w: Array) -> None:
    """Turn the means (2, 3) with the body and add a sample; at first they are those of all.

    Args:
        means: (2, 3) over `MEANS_S` [m/s²].
        sample: (2, 3) rate [rad/s] and specific force [m/s²].
        dt: Since the last one [s].
        elapsed_s: Since the first one [s].
        w: (4, 3) scratch memory.
    """
    omega, force = sample[0], sample[1]
    put_exp(-dt * omega[0], -dt * omega[1], -dt * omega[2], w[:3])
    for k in range(2):
        share = max(dt / (dt + MEANS_S[k]), dt / (dt + elapsed_s))
        turn(w[:3], means[k], w[3])
        for i in range(3):
            means[k, i] = w[3, i] + share * (force[i] - w[3, i])
