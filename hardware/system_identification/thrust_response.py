"""Thrusts that follow held commands with a delay and a first-order lag, exactly, at any of both."""

from __future__ import annotations

from math import ceil, exp

import numpy as np
from scipy.signal import lfilter

from pipeline.frames import Array


def thrust_response(commands: Array, lag: float, delay: float, period: float) -> Array:
    """Thrusts (n, m) at the times at which `commands` (n, m) were given, one each `period` [s].

    Smooth in `lag` and `delay` [s], though commands are steps. Before the first one thrusts are
    what it commands.
    """
    stays = exp(-period / lag)
    at_arrival, _ = lfilter([0.0, 1.0 - stays], [1.0, -stays], commands, axis=0, zi=commands[:1])
    periods = ceil(delay / period)
    since_arrival = periods * period - delay
    thrusts: Array = commands + (at_arrival - commands) * exp(-since_arrival / lag)
    if periods == 0:
        return thrusts
    return np.vstack((np.repeat(thrusts[:1], periods, axis=0), thrusts[:-periods]))
