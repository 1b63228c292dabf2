"""Compiled: LEDs in a picture whose date is hardly known, beside what is linear in that date.

By a time offset that is wrong by δ an LED is seen ρ δ beside where it is expected, ρ being how fast
it passes. Two parts of that are in no H. ρ is doubted itself, as u and the gyroscopes' biases are:
then δ ρ has the mean cov(δ, ρ) and the variance var δ var ρ + cov(δ, ρ)², a second-order filter of
one product (Athans, Wishner & Bertolini 1968, IEEE TAC 13). And ρ is no constant over the σ of δ
where a hand trembles: a parabola through ρ at −√3 σ, 0 and √3 σ, as Gauss and Hermite weigh them,
gives the slope that explains most, its mean and what it leaves. Without either a phone at rest,
dated wrongly by 15 ms, was taken to be right to 8.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.estimation.relative_kernels import BIASES, OFFSET
from pipeline.frames import Array
from pipeline.so3_kernels import kernel

AT = sqrt(3.0)
"""Standard deviations of the time offset at which inputs are asked for, on both sides of a date."""
OF_RATE = np.array([6, 7, 8, BIASES, BIASES + 1, BIASES + 2, BIASES + 6, BIASES + 7, BIASES + 8])
"""Error states that ρ depends on most: δu, and the biases of ω_b and of ω_c."""


@kernel
def put_velocity(
    u: Array, R: Array, inputs: Array, told: Array, led: Array, q: Array, by_body: Array, v: Array
) -> None:
    """How fast an LED at q (3,) in c moves there (3,) [m/s]: u − ω_c × q, and as its body does.

    `by_body` (3,) is the latter alone: what it tells of its velocity, and R (ω_b × led).
    """
    b, w = inputs[0:3], inputs[6:9]
    for i in range(3):
        by_body[i] = told[i]
    for m in range(3):
        j, k = (m + 1) % 3, (m + 2) % 3
        spin = b[j] * led[k] - b[k] * led[j]
        for i in range(3):
            by_body[i] += R[i, m] * spin
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        v[i] = u[i] - (w[j] * q[k] - w[k] * q[j]) + by_body[i]


@kernel
def put_acceleration(u: Array, R: Array, now: Array, then: Array, a: Array) -> None:
    """u̇ = R f_b − f_c − ω_c × u (3,) [m/s²] by the mean of two times' inputs."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a[i] = -0.5 * (now[9 + i] + then[9 + i]) - (now[6 + j] * u[k] - now[6 + k] * u[j])
        for m in range(3):
            a[i] += 0.5 * R[i, m] * (now[3 + m] + then[3 + m])


@kernel
def doubt_date(
    x: Array,
    R: Array,
    P: Array,
    inputs: Array,
    told: Array,
    led: Array,
    H: Array,
    miss: Array,
    C: Array,
) -> float:
    """Let H (2, 8), miss (2,) and C (2, 2) of an LED have what its date's doubt does to them.

    `inputs` (3, 12) are those at `AT` standard deviations before the state's time, then, and after.
    Gives the variance of ρ, both rows together [rad²/s²].
    """
    sigma = sqrt(P[OFFSET, OFFSET])
    q, a, u, v, by_body = R @ led, np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    rates = np.empty((2, 2))
    q += x[0:3]
    for side in range(2):
        put_acceleration(x[3:6], R, inputs[1], inputs[2 * side], a)
        for i in range(3):
            u[i] = x[3 + i] + (2 * side - 1) * AT * sigma * a[i]
        put_velocity(u, R, inputs[2 * side], told, led, q, by_body, v)
        for row in range(2):
            rates[side, row] = H[row, 0] * v[0] + H[row, 1] * v[1] + H[row, 2] * v[2]
    J, mean, odd, bent = np.empty((2, len(OF_RATE))), np.zeros(2), np.empty(2), np.empty(2)
    for row in range(2):
        for j in range(3):
            k, m = (j + 1) % 3, (j + 2) % 3
            J[row, j], J[row, 3 + j] = H[row, j], -H[row, 3 + j]
            J[row, 6 + j] = H[row, m] * q[k] - H[row, k] * q[m]  # −D [q]×
        for j in range(len(OF_RATE)):
            mean[row] += J[row, j] * P[OF_RATE[j], OFFSET]
        odd[row] = (rates[1, row] - rates[0, row]) / (4.0 * AT)
        bent[row] = rates[1, row] + rates[0, row] - 2.0 * H[row, 6]
    doubt = 0.0  # of ρ
    for row in range(2):
        miss[row] -= mean[row] + sigma * odd[row]
        H[row, 6] += bent[row] / 6.0
        for column in range(2):
            rate, variance = 0.0, 2.0 * odd[row] * odd[column] + bent[row] * bent[column] / 54.0
            for j in range(len(OF_RATE)):
                for k in range(len(OF_RATE)):
                    rate += J[row, j] * P[OF_RATE[j], OF_RATE[k]] * J[column, k]
            variance += rate
            doubt += rate if row == column else 0.0
            C[row, column] += P[OFFSET, OFFSET] * variance + mean[row] * mean[column]
    return doubt
