"""Compiled arithmetic of `sample_noise`: samples against those around them."""

from __future__ import annotations

from math import exp, sqrt

from pipeline.frames import Array
from pipeline.imu_stream import MAX_GAP_S
from pipeline.so3_kernels import kernel

LAGS = 5
RING = 2 * LAGS + 1
"""Samples that are looked at together."""
EVEN = 0.25
"""Share of the time between two samples, at least, that is on either side of the one between."""
MEMORY_S = 0.5
"""In which what was seen fades: tens of samples of a phone."""


OUTLYING = 4.0
"""Times what is expected: more than this no sample teaches, a knock is not noise."""
MOST, MOST_MOTION = 2e3, 1e6
"""Times the variance a sensor should have: of noise, beyond which it is broken, and of motion."""


@kernel
def hear(
    t: float,
    rate: Array,
    force: Array,
    times: Array,
    ring: Array,
    count: int,
    usual: Array,
    squares: Array,
    levels: Array,
) -> int:
    """Take a sample of `t` [s] as the newest of `ring` (RING, 6); gives how many it holds.

    Mixes into squares (2, LAGS), by sensor and lag, how far a sample is from the line between the
    one `lag` before and the one as long after it: of the noise's variance, were it white. Puts into
    levels (2, 2), by sensor: standard deviation of the noise of an axis [unit], density of a random
    walk that explains the rest [unit/s/√Hz]. usual (2,): variances that are expected of sensors.
    """
    if count > 0 and not 0.0 < t - times[0] < MAX_GAP_S:
        if t <= times[0]:
            return count
        count = 0
    if count > 1 and t - times[0] < EVEN * (times[0] - times[1]):
        return count  # its like was there
    for k in range(min(count, RING - 1), 0, -1):
        times[k] = times[k - 1]
        ring[k] = ring[k - 1]
    times[0], ring[0, 0:3], ring[0, 3:6] = t, rate, force
    count = min(count + 1, RING)
    if count < RING:
        return count
    keep = exp((times[1] - t) / MEMORY_S)
    for lag in range(1, LAGS + 1):
        share = (times[lag] - t) / (times[2 * lag] - t)
        if not EVEN < share < 1.0 - EVEN:
            continue
        scale = 1.0 / (1.0 + share * share + (1.0 - share) * (1.0 - share))
        for sensor in range(2):
            square = 0.0
            for k in range(3 * sensor, 3 * sensor + 3):
                e = ring[lag, k] - share * ring[2 * lag, k] - (1.0 - share) * ring[0, k]
                square += e * e
            square *= scale / 3.0
            before = squares[sensor, lag - 1]
            square = min(square, OUTLYING * max(before, usual[sensor]), MOST_MOTION * usual[sensor])
            squares[sensor, lag - 1] += (1.0 - keep) * (square - squares[sensor, lag - 1])
    period = (t - times[RING - 1]) / (RING - 1)
    for sensor in range(2):
        V = squares[sensor]
        nugget = max(0.0, min(2.0 * V[0] - V[1], V.min(), MOST * usual[sensor]))
        levels[sensor, 0] = sqrt(nugget)
        levels[sensor, 1] = sqrt(3.0 * (V[0] - nugget) / period)
    return count
