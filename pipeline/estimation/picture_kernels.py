"""Compiled: a picture's pose beside the relative state that predicted it, and what it corrects.

e (6,) is by how much it is off, δp in c [m] and θ in b [rad] with R = R̂ Exp(θ), and S (6, 6) the
covariance of that; P (22, 22), or larger with a tone, is the state's.
"""

from __future__ import annotations

from math import inf

import numpy as np

from pipeline.estimation.innovation_kernels import normalised
from pipeline.estimation.relative_kernels import BIASES, OFFSET
from pipeline.frames import Array
from pipeline.linear_kernels import cholesky, solve_by
from pipeline.so3_kernels import kernel

SENSORS, POSE = 4, 6
ROUNDING = 1e-18
"""No variance that pictures take from a bias is told from nothing below it [unit²]."""


@kernel
def put_corrections(
    e: Array, S: Array, P: Array, most: float, shift: Array, reduction: Array
) -> float:
    """What a picture corrects of the four sensors' biases, and by how much it lowers their doubt.

    Into `shift` (4, 3), cut to that of a χ² of `most`, and `reduction` (4, 3, 3). Gives χ² by its
    six degrees; inf without such S.
    """
    L, x, gain = S.copy(), e.copy(), np.empty(POSE)
    if not cholesky(L, 0.0):
        return inf
    solve_by(L, x)
    surprise = 0.0
    for i in range(POSE):
        surprise += e[i] * x[i] / POSE
    cut = min(1.0, np.sqrt(most / surprise)) if surprise > 0.0 else 1.0
    for k in range(SENSORS):
        for j in range(3):
            row = BIASES + 3 * k + j
            shift[k, j] = 0.0
            for i in range(POSE):
                gain[i] = P[row, i]
                shift[k, j] += cut * gain[i] * x[i]
            solve_by(L, gain)
            for m in range(3):
                reduction[k, j, m] = 0.0
                for i in range(POSE):
                    reduction[k, j, m] += gain[i] * P[BIASES + 3 * k + m, i]
    return surprise


@kernel
def put_chi2(shift: Array, variance: Array, chi2: Array) -> None:
    """χ² (4,) of each sensor's sum of corrections (4, 3) by its variance (4, 3, 3), by three."""
    for k in range(SENSORS):
        V = variance[k] + ROUNDING * np.eye(3)
        chi2[k] = normalised(shift[k], V)


@kernel
def pose_in_picture(P: Array, passing: Array) -> Array:
    """(6, 6) of the pose in a picture whose date is off as the state's: [1 a] P [1 a]ᵀ."""
    seen = np.empty((POSE, POSE))
    for i in range(POSE):
        for j in range(POSE):
            seen[i, j] = P[i, j] + passing[i] * P[OFFSET, j] + P[i, OFFSET] * passing[j]
            seen[i, j] += passing[i] * P[OFFSET, OFFSET] * passing[j]
    return seen


@kernel
def pose_rate(x: Array, R: Array, inputs: Array, told: Array) -> Array:
    """(6,) how the pose passes: ṗ = u + told − ω_c × p in c [m/s], ω_b − Rᵀ ω_c in b [rad/s]."""
    rate, w = np.empty(POSE), inputs[6:9]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rate[i] = x[3 + i] + told[i] - (w[j] * x[k] - w[k] * x[j])
        rate[3 + i] = inputs[i] - (R[0, i] * w[0] + R[1, i] * w[1] + R[2, i] * w[2])
    return rate
