"""Hand-motion predictor: the angular rate of a hand some dozen milliseconds ahead.

Physiological tremor is noise in a narrow band around 8-12 Hz (Timmer et al. 1998): sixty samples a
second say well how it goes on for half a period. Gaussian process regression of the angular rate
over the newest samples (Rasmussen & Williams 2006), with the covariance

    k(τ) = slow² exp(−τ²/2 length²) + tremor² exp(−τ/coherence) cos(2π frequency τ)

gives the rate beyond the last sample, and how wrong that may be.
"""

from __future__ import annotations

from math import cos, exp, pi, sqrt

from pipeline.frames import Array
from pipeline.so3_kernels import kernel

TAPS = 8
"""Samples looked at: a little more than one period of a tremor at 60 Hz."""


@kernel
def covariance(tau: float, hand: Array) -> float:
    """k(τ) [rad²/s²]; hand (6,): slow, length, tremor, frequency [Hz], coherence, noise."""
    slow = hand[0] * hand[0] * exp(-0.5 * (tau / hand[1]) ** 2)
    return float(
        slow + hand[2] * hand[2] * exp(-abs(tau) / hand[4]) * cos(2.0 * pi * hand[3] * tau)
    )


@kernel
def learn(times: Array, rates: Array, bias: Array, hand: Array, L: Array, alpha: Array) -> int:
    """Cholesky factor L (n, n) of the newest samples' covariance, and K⁻¹ of their rates (n, 3).

    Gives n, up to `TAPS`; `bias` (3,) is taken off the rates.
    """
    n = int(min(TAPS, times.shape[0]))
    first = times.shape[0] - n
    for i in range(n):
        for j in range(i + 1):
            s = covariance(times[first + i] - times[first + j], hand)
            if i == j:
                s += hand[5] * hand[5]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = sqrt(max(s, 1e-12)) if i == j else s / L[j, j]
    for axis in range(3):
        for i in range(n):
            y = rates[first + i, axis] - bias[axis]
            for k in range(i):
                y -= L[i, k] * alpha[k, axis]
            alpha[i, axis] = y / L[i, i]
        for i in range(n - 1, -1, -1):
            y = alpha[i, axis]
            for k in range(i + 1, n):
                y -= L[k, i] * alpha[k, axis]
            alpha[i, axis] = y / L[i, i]
    return n


@kernel
def extrapolate(
    times: Array, n: int, t: float, hand: Array, L: Array, alpha: Array, out: Array
) -> float:
    """Rate (3,) at `t` after the last sample, bias taken off; gives its standard deviation."""
    first, variance = times.shape[0] - n, covariance(0.0, hand)
    out[0] = out[1] = out[2] = 0.0
    v = L[TAPS]
    for i in range(n):
        k = covariance(t - times[first + i], hand)
        for axis in range(3):
            out[axis] += k * alpha[i, axis]
        for j in range(i):
            k -= L[i, j] * v[j]
        v[i] = k / L[i, i]
        variance -= v[i] * v[i]
    return sqrt(max(variance, 0.0))
