"""What an IMU measured at any time: between its samples, beyond them, and how sure that is."""

from __future__ import annotations

from pipeline.frames import Array
from pipeline.imu_stream import MAX_GAP_S
from pipeline.so3_kernels import kernel

NEAR_S = 0.012
"""So near to a sample, interpolation is as good as the sample."""
APART = 0.25
"""Share of the time between two samples that their neighbours must be from them: a curve through
nearer ones follows their noise or their stamps' rounding, not the motion."""
EXCESS, EXCESS_S = 0.25, 0.1
"""By this share of full scale, and for so long, there is more than is said: a hand that shakes."""


@kernel
def sample_at(times: Array, values: Array, i: int, t: float, out: Array) -> float:
    """Sample (n,) at `t`, between samples i and i + 1, or the last one; gives how far beyond it."""
    n, width = times.shape[0], out.shape[0]
    if i < 0:
        out[:] = values[0, :width]
        return float(times[0] - t)
    if i < n - 1:
        share = (t - times[i]) / (times[i + 1] - times[i])
        for k in range(width):
            out[k] = values[i, k] + share * (values[i + 1, k] - values[i, k])
        if i >= 1 and i + 2 < n and times[i + 2] - times[i - 1] < MAX_GAP_S:
            near = APART * (times[i + 1] - times[i])
            if times[i] - times[i - 1] >= near and times[i + 2] - times[i + 1] >= near:
                _bend(times, values, i, t, out)
        return 0.0
    for k in range(width):
        out[k] = values[i, k]
    return float(t - times[i])


@kernel
def _bend(times: Array, values: Array, i: int, t: float, out: Array) -> None:
    """Make the line between samples i and i + 1 the cubic through their neighbours as well.

    At 60 Hz a line cuts a tenth off a 10 Hz tremor, the cubic a fiftieth. In Newton's form.
    """
    t0, t1, t2, t3 = times[i], times[i + 1], times[i - 1], times[i + 2]
    square = (t - t0) * (t - t1)
    for k in range(out.shape[0]):
        d01 = (values[i + 1, k] - values[i, k]) / (t1 - t0)
        d12 = (values[i - 1, k] - values[i + 1, k]) / (t2 - t1)
        d23 = (values[i + 2, k] - values[i - 1, k]) / (t3 - t2)
        d012, d123 = (d12 - d01) / (t2 - t0), (d23 - d12) / (t3 - t1)
        out[k] += square * (d012 + (t - t2) * (d123 - d012) / (t3 - t0))


@kernel
def put_noise(
    times: Array, values: Array, i: int, t: float, beyond: float, noise: Array, h: float, s: Array
) -> None:
    """Densities (n,) of a sample's noise at `t`, and of what the samples don't say of the truth.

    Between two samples the truth leaves the straight line like a Brownian bridge; beyond the last
    one it walks away, and may go on in a direction that nobody has seen. A sample at full scale
    says only that there is more.
    """
    n = times.shape[0]
    period, far = h, beyond
    if 0 <= i < n - 1:
        period = min(times[i + 1] - times[i], MAX_GAP_S)
        far = max(0.0, min(t - times[i], times[i + 1] - t) - NEAR_S)
    elif i > 0:
        period = min(times[i] - times[i - 1], MAX_GAP_S)
    for k in range(s.shape[0]):
        white, rough, drift = noise[0, k // 3], noise[1, k // 3], noise[2, k // 3]
        s[k] = white * white * max(period, h)
        s[k] += rough * rough * (period * period / 12.0 + far * far)
        s[k] += drift * drift * far * far * far
        full_scale, near = noise[3, k // 3], min(max(i, 0), n - 1)
        loudest = max(abs(values[near, k]), abs(values[min(near + 1, n - 1), k]))
        if loudest >= full_scale:
            s[k] += (EXCESS * full_scale) ** 2 * EXCESS_S
