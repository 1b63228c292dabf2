"""Hand-motion predictor: a hand's angular rate after the phone's last sample, learnt in flight.

What a hand does next is different for each person, and for each thing that the person does:
filming has a hump at 5 Hz, a tremor a line anywhere from 4 to 13 Hz, a phone that lies has neither.
So the newest rates are regressed on those before them, by recursive least squares that forget
(Åström & Wittenmark, Adaptive Control, 1995). What a forecast got wrong is known a few samples
later, and costs nothing: it says how far the next is to be doubted, and which kind to use, of the
learnt one, holding the last rate, and expecting none. So none is used that was worse than holding.
"""

from __future__ import annotations

from collections import deque
from functools import cache
from math import exp
from typing import Final, get_args

import numpy as np

from pipeline.estimation.hand_motion_kernels import (
    AHEAD,
    STEP_S,
    TAPS,
    WINDOW,
    learn,
    put_forecast,
    put_window,
    score,
)
from pipeline.estimator_config import HandConfig, HandPrediction
from pipeline.frames import Array
from pipeline.imu_stream import ImuStream

KINDS: Final[tuple[HandPrediction, ...]] = get_args(HandPrediction)
LEARNT: Final = KINDS.index("learnt")
NOTHING: Final = np.zeros((0, 6))
"""The forecast while the samples don't suffice for one."""
JUDGED: Final = 6
"""Points whose doubt decides between the kinds: 0.1 s."""
ON_TIME: Final = 0.9
"""Share of a step after which a sample is worth learning from."""
SETTLED_S: Final = 0.25
"""So old a sample is when it is learnt from: by then those before it are there, in any order."""
WARM: Final = 8
"""Forecasts that the average hand counts for."""


class HandPredictor:
    """Forecasts by one kind, or by the one that has been the best."""

    def __init__(self, config: HandConfig) -> None:
        """Expect the average hand of `config`."""
        self._config = config
        self._prior, weights, turns = _average(config)
        self._weights = weights.copy()
        self.turns = turns.copy()
        """(kinds, AHEAD, 3) mean square of what forecasts of each kind got wrong [rad²]."""
        self._keep = exp(-STEP_S / config.memory_s)
        self._A, self._B = np.zeros((TAPS, TAPS)), np.zeros((TAPS, AHEAD))
        self._then = deque([self._prior.copy()], maxlen=AHEAD)
        """Learnt weights, oldest first: of when the forecast was made that is now judged."""
        self._window = np.zeros((WINDOW, 3))
        self._t_learnt, self._count = -np.inf, 0
        self.forecast = NOTHING
        """(AHEAD + 1, 6), as `forecast_at` takes it."""

    @property
    def kind(self) -> HandPrediction:
        """The kind of the forecasts now."""
        if self._config.predictor != "learnt":
            return self._config.predictor
        return KINDS[int(np.argmin(self.turns[:, :JUDGED].sum(axis=(1, 2))))]

    def follow(self, samples: ImuStream) -> None:
        """Learn from the phone's `samples`, one of them new, and forecast after the last."""
        times, values = samples.times, samples.values
        settled = times[-1] - SETTLED_S
        i = int(np.searchsorted(times, self._t_learnt + ON_TIME * STEP_S))
        while i < len(times) and times[i] <= settled:
            self._t_learnt = float(times[i])
            if put_window(times, values, i, self._window) == WINDOW:
                self._learn()
            i = int(np.searchsorted(times, self._t_learnt + ON_TIME * STEP_S))
        newest = self._window[:TAPS]
        if put_window(times, values, len(times) - 1, newest) < TAPS:
            self.forecast = NOTHING
            return
        k, self.forecast = KINDS.index(self.kind), np.empty((AHEAD + 1, 6))
        put_forecast(newest, self._weights[k], self.turns[k], self.forecast)

    def _learn(self) -> None:
        self._count += 1
        newest, self._weights[LEARNT] = self._weights[LEARNT].copy(), self._then[0]
        share = max(1.0 - self._keep, 1.0 / (self._count + WARM))
        score(self._window, self._weights, share, self.turns)
        strength = 3.0 * self._config.prior_s / STEP_S * self._config.noise**2
        learn(self._window, self._keep, strength, self._prior, self._A, self._B, newest)
        self._weights[LEARNT] = newest
        self._then.append(newest.copy())


@cache
def _average(config: HandConfig) -> tuple[Array, Array, Array]:
    """The average hand's weights (TAPS, AHEAD); those of each kind; what these get wrong of it."""
    past, prior = _rates(config)
    weights = np.zeros((len(KINDS), TAPS, AHEAD))
    weights[LEARNT] = prior
    weights[KINDS.index("hold"), 0] = 1.0
    return prior, weights, np.array([_turns(past, of_kind) for of_kind in weights])


def _rates(c: HandConfig) -> tuple[Array, Array]:
    """Covariance (TAPS + AHEAD, same) of the average hand's rates, past first; its weights.

    k(τ) = slow² exp(−τ²/2 length²) + tremor² exp(−τ/coherence) cos(2π frequency τ): Gaussian
    process regression (Rasmussen & Williams 2006).
    """
    t = STEP_S * np.concatenate((-np.arange(TAPS), 1.0 + np.arange(AHEAD)))
    tau = np.abs(t[:, None] - t)
    slow = c.slow**2 * np.exp(-0.5 * np.square(tau / c.length_s))
    shake = c.tremor**2 * np.exp(-tau / c.coherence_s) * np.cos(2.0 * np.pi * c.tremor_hz * tau)
    C: Array = slow + shake + c.noise**2 * np.eye(len(t))
    return C, np.asarray(np.linalg.solve(C[:TAPS, :TAPS], C[:TAPS, TAPS:]), dtype=np.float64)


def _turns(C: Array, weights: Array) -> Array:
    """(AHEAD, 3) mean square of what forecasts of a hand of covariance C get wrong [rad²]."""
    error = np.concatenate((-weights, np.eye(AHEAD)))
    adding = STEP_S * (np.triu(np.ones((AHEAD, AHEAD))) - 0.5 * np.eye(AHEAD))
    turn = error @ adding
    return np.repeat(np.einsum("ik,ij,jk->k", turn, C, turn)[:, None], 3, axis=1)
