"""What an IMU felt at any time: between its samples, beyond them, and how sure that is."""

from __future__ import annotations

from pipeline.frames import Array
from pipeline.so3_kernels import kernel

NEAR_S = 0.012
"""So near to a sample, interpolation is as good as the sample."""
MAX_GAP_S = 0.1
"""Samples farther apart than this say nothing of each other."""


@kernel
def sample_at(times: Array, values: Array, i: int, t: float, out: Array) -> float:
    """Sample (6,) at `t`, between samples i and i + 1, or the last one; gives how far beyond it."""
    n = times.shape[0]
    if i < 0:
        out[:] = values[0]
        return float(times[0] - t)
    if i < n - 1:
        share = (t - times[i]) / (times[i + 1] - times[i])
        for k in range(6):
            out[k] = values[i, k] + share * (values[i + 1, k] - values[i, k])
        return 0.0
    for k in range(6):
        out[k] = values[i, k]
    return float(t - times[i])


@kernel
def put_noise(
    times: Array, i: int, t: float, beyond: float, noise: Array, h: float, s: Array
) -> None:
    """Densities (6,) of a sample's noise at `t`, and of what the samples don't say of the truth.

    Between two samples the truth leaves the straight line like a Brownian bridge; beyond the last
    one it walks away, and may go on in a direction that nobody has seen.
    """
    n = times.shape[0]
    period, far = h, beyond
    if 0 <= i < n - 1:
        period = min(times[i + 1] - times[i], MAX_GAP_S)
        far = max(0.0, min(t - times[i], times[i + 1] - t) - NEAR_S)
    elif i > 0:
        period = min(times[i] - times[i - 1], MAX_GAP_S)
    for k in range(6):
        white, rough, drift = noise[0, k // 3], noise[1, k // 3], noise[2, k // 3]
        s[k] = white * white * max(period, h)
        s[k] += rough * rough * (period * period / 12.0 + far * far)
        s[k] += drift * drift * far * far * far
