"""Compiled arithmetic of `hand_predictor`: forecasts of a hand's angular rate, learnt and scored.

A forecast is linear: the rates at the next `AHEAD` points of a grid are weights times those at the
last `TAPS`. Holding the last rate, and expecting none, are weights as well.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from pipeline.estimation.imu_interpolation_kernels import sample_at
from pipeline.frames import Array
from pipeline.imu_stream import MAX_GAP_S
from pipeline.so3_kernels import kernel

STEP_S = 1.0 / 60.0
"""Of the grid: a browser's samples are not closer."""
TAPS = 8
"""Points looked back at."""
AHEAD = 8
"""Points predicted."""
PREDICTED_S = AHEAD * STEP_S
WINDOW = TAPS + AHEAD


@kernel
def put_window(times: Array, values: Array, last: int, window: Array) -> int:
    """Rates (n, 3) at the sample `last` and each step before it; gives how many.

    There are fewer than asked for where the samples end, or have a gap.
    """
    i, sample = last, np.empty(6)
    for j in range(window.shape[0]):
        t = times[last] - j * STEP_S
        while i >= 0 and times[i] > t:
            i -= 1
        if i < 0 or (i < last and times[i + 1] - times[i] > MAX_GAP_S):
            return j
        sample_at(times, values, i, t, sample)
        window[j] = sample[0:3]
    return int(window.shape[0])


@kernel
def score(window: Array, weights: Array, share: float, turns: Array) -> None:
    """Mix what one forecast of each kind got wrong into `turns`.

    `window` (WINDOW, 3): what came (AHEAD), and what the forecasts were made of (TAPS), newest
    first; weights (kinds, TAPS, AHEAD); turns (kinds, AHEAD, 3): mean squares of the turn from the
    last sample until each point [rad²], about each axis.
    """
    for kind in range(weights.shape[0]):
        for axis in range(3):
            turn, before = 0.0, 0.0
            for k in range(AHEAD):
                error = window[AHEAD - 1 - k, axis]
                for i in range(TAPS):
                    error -= weights[kind, i, k] * window[AHEAD + i, axis]
                turn += 0.5 * STEP_S * (before + error)
                before = error
                turns[kind, k, axis] += share * (turn * turn - turns[kind, k, axis])


@kernel
def learn(
    window: Array, keep: float, strength: float, prior: Array, A: Array, B: Array, weights: Array
) -> None:
    """Regress what came on what was before it, older samples fading by `keep` each time.

    A (TAPS, TAPS), B (TAPS, AHEAD): sums of products; all axes share the weights. A ridge of
    `strength` [rad²/s²] holds them at the `prior` (TAPS, AHEAD) while the hand says little.
    """
    L = np.empty((TAPS, TAPS))
    for i in range(TAPS):
        for j in range(i + 1):
            s = 0.0
            for axis in range(3):
                s += window[AHEAD + i, axis] * window[AHEAD + j, axis]
            A[i, j] = keep * A[i, j] + s
        for k in range(AHEAD):
            s = 0.0
            for axis in range(3):
                s += window[AHEAD + i, axis] * window[AHEAD - 1 - k, axis]
            B[i, k] = keep * B[i, k] + s
    for i in range(TAPS):
        for j in range(i + 1):
            s = A[i, j] + (strength if i == j else 0.0)
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = sqrt(s) if i == j else s / L[j, j]
    for k in range(AHEAD):
        for i in range(TAPS):
            s = B[i, k] + strength * prior[i, k]
            for j in range(i):
                s -= L[i, j] * weights[j, k]
            weights[i, k] = s / L[i, i]
        for i in range(TAPS - 1, -1, -1):
            s = weights[i, k]
            for j in range(i + 1, TAPS):
                s -= L[j, i] * weights[j, k]
            weights[i, k] = s / L[i, i]


@kernel
def put_forecast(window: Array, weights: Array, turns: Array, out: Array) -> None:
    """Forecast (AHEAD + 1, 6) by weights (TAPS, AHEAD) from the newest rates `window` (TAPS, 3).

    Rows: the last sample and the points after it. Columns: the rate, and the standard deviation of
    the turn by then, from mean squares `turns` (AHEAD, 3).
    """
    for axis in range(3):
        out[0, axis], out[0, 3 + axis] = window[0, axis], 0.0
        for k in range(AHEAD):
            rate = 0.0
            for i in range(TAPS):
                rate += weights[i, k] * window[i, axis]
            out[1 + k, axis], out[1 + k, 3 + axis] = rate, sqrt(turns[k, axis])


@kernel
def forecast_at(forecast: Array, after: float, out: Array) -> None:
    """Row (6,) of a forecast `after` the last sample [s]: beyond its end the doubt goes on."""
    share = max(after, 0.0) / STEP_S
    k = int(min(int(share), AHEAD - 1))
    share -= k
    for i in range(6):
        step = forecast[k + 1, i] - forecast[k, i]
        out[i] = forecast[k, i] + (min(share, 1.0) if i < 3 else share) * step
