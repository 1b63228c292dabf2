"""How a robot that hangs turned, by its own motion sensors alone, from a rest at the beginning.

The gyroscope, integrated, knows each turn; what it can't know are its bias and how the robot hung
as it began. Both follow from gravity over the whole record: while the robot swings, the specific
force averages to the vertical (a mean over seconds), and what the accelerometer is off by turns
with the robot, which tells it from a tilt. All three enter linearly and are solved at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from hardware.plant_parameters import BodyImuParameters
from pipeline.config import PERIOD_S
from pipeline.frames import GRAVITY, UP, Array, R_between, exp, skew

REST_S: Final = 2.0
"""At the beginning; the gyroscope's mean there is its bias, to begin with."""
MEAN_S: Final = 1.0
"""Of the specific force: about half a swing."""
SWING_M_S2: Final = 0.05
"""What is left of a swing in such a mean."""
TILT_RAD: Final = 0.05
"""How far from upright a robot hangs, one axis."""
DRIFT_RAD_S: Final = 2e-4
"""By which the bias in the rest may be wrong."""
ROUNDS: Final = 3
"""Of small angles: the next one corrects less than a thousandth of the one before."""


@dataclass(frozen=True, slots=True, eq=False)
class ImuAttitude:
    """What the sensors tell, each `PERIOD_S`."""

    R_fs: Array
    """(n, 3, 3) from the sensors' axes to f; its yaw begins at 0."""
    omega_in_s: Array
    """(n, 3) without bias [rad/s]."""
    force_in_s: Array
    """(n, 3) without bias, as far as turning told it [m/s²]."""


def attitude_by_imu(omega_in_s: Array, force_in_s: Array, imu: BodyImuParameters) -> ImuAttitude:
    """From samples (n, 3) [rad/s], [m/s²] each `PERIOD_S`, at rest for the first `REST_S`."""
    rest = round(REST_S / PERIOD_S)
    bias, bias_force = omega_in_s[:rest].mean(axis=0), np.zeros(3)
    hangs = force_in_s[:rest].mean(axis=0)
    # sensors that are turned are not upright; those that are have a robot under a hook, upright
    is_upright = hangs[2] > np.linalg.norm(hangs) * np.cos(3.0 * TILT_RAD)
    start: Array = np.eye(3) if is_upright else R_between(hangs / np.linalg.norm(hangs), UP)
    for _ in range(ROUNDS):
        R_fs = _integrated(start, omega_in_s - bias)
        start, bias, bias_force = _corrected(R_fs, force_in_s, start, bias, bias_force, imu)
    R_fs = _integrated(start, omega_in_s - bias)
    return ImuAttitude(R_fs, omega_in_s - bias, force_in_s - bias_force)


def _integrated(start: Array, omega: Array) -> Array:
    R_fs = np.empty((len(omega), 3, 3))
    R_fs[0] = start
    for k, turn in enumerate(0.5 * PERIOD_S * (omega[1:] + omega[:-1]), start=1):
        R_fs[k] = R_fs[k - 1] @ exp(turn)
    return R_fs


def _corrected(
    R_fs: Array,
    force_in_s: Array,
    start: Array,
    bias: Array,
    bias_force: Array,
    imu: BodyImuParameters,
) -> tuple[Array, Array, Array]:
    """Start (3, 3) and both biases (3,) that bring means of the specific force to the vertical."""
    force_in_f = np.einsum("nij,nj->ni", R_fs, force_in_s - bias_force)
    turned = PERIOD_S * np.cumsum(R_fs, axis=0)
    means = [_means(series) for series in (force_in_f, R_fs, turned)]
    tilts = -skew(GRAVITY * UP)
    rows = [
        np.hstack((tilts[:, :2], -tilts @ by_drift, -by_force)) / SWING_M_S2
        for by_force, by_drift in zip(means[1], means[2], strict=True)
    ]
    acc = max(imu.acc_bias, 1e-3)
    known = np.diag(1.0 / np.repeat((TILT_RAD, DRIFT_RAD_S, acc), (2, 3, 3)))
    off = ((GRAVITY * UP - means[0]) / SWING_M_S2).ravel()
    expected = np.concatenate((np.zeros(5), -bias_force / acc))
    found, *_ = np.linalg.lstsq(np.vstack((*rows, known)), np.concatenate((off, expected)))
    tilt = np.array((*found[:2], 0.0))
    return exp(tilt) @ start, bias + found[2:5], bias_force + found[5:]


def _means(series: Array) -> Array:
    """Of each whole stretch of `MEAN_S`."""
    samples = round(MEAN_S / PERIOD_S)
    whole = len(series) // samples * samples
    means: Array = series[:whole].reshape(-1, samples, *series.shape[1:]).mean(axis=1)
    return means
