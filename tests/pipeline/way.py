"""A state and its covariance on their way through the samples of two IMUs."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.hand_predictor import NOTHING, HandPredictor
from pipeline.estimation.relative_kernels import INPUTS, X_BIASES, N, X, apply, transit
from pipeline.estimation.relative_noise import noise_of, walks_of
from pipeline.estimator_config import HandConfig, RelativeConfig
from pipeline.frames import GRAVITY, R_from_rpy
from pipeline.imu_stream import ImuStream

UP = np.array([0.0, 0.0, GRAVITY])
BIAS = np.repeat((0.02, -0.3, 0.004, 0.1), 3)


def samples(start, stop, period, seed, phase=0.0):
    """(times, values) of an IMU on an unquiet hand."""
    rng = np.random.default_rng(seed)
    t = np.arange(start + phase, stop, period)
    waves = np.sin(rng.uniform(2.0, 9.0, 6) * t[:, None] + rng.uniform(0.0, 6.0, 6))
    return t, waves * np.repeat((0.6, 1.5), 3) + np.append(np.zeros(3), UP)


BODY, PHONE = samples(0.0, 1.0, 0.005, 1), samples(0.0, 1.0, 1 / 60, 2, 0.003)


def forecast_after(phone):
    """What the samples (times, values) let expect of the hand."""
    predictor, stream = HandPredictor(HandConfig()), ImuStream()
    for t, value in zip(*phone, strict=True):
        stream.insert(t, value[:3], value[3:])
        predictor.follow(stream)
    return predictor.forecast


class Way:
    """A state with its covariance, carried along samples."""

    def __init__(self, body=BODY, phone=PHONE, *, predicts=False, tone=None):
        """The phone's last sample is held, or what follows it is predicted.

        `tone`: rate [rad/s] and a time without phase [s] of one with amplitudes in the state.
        """
        self.config, self.body, self.phone = RelativeConfig(), body, phone
        self.predicts, self.full_scale = predicts, np.inf
        self.x, self.R, self.R_ic = np.zeros(X), R_from_rpy(np.array([0.1, -0.2, 0.4])), np.eye(3)
        self.x[:6] = 2.5, 0.1, -0.2, 0.3, -0.1, 0.2
        self.x[X_BIASES : X_BIASES + INPUTS] = BIAS
        self.P = np.diag(
            np.repeat((1e-3, 1e-3, 3e-2, 1e-2, 1e-1, 2e-3, 3e-2, 5e-3), (3,) * 7 + (1,)) ** 2
        )
        self.tone, self.walks = tone or (0.0, 0.0), walks_of(self.config)
        if tone:
            self.x = np.append(self.x, np.zeros(12))
            self.P = np.diag(np.append(self.P.diagonal(), np.full(12, 0.01)))
            self.walks = np.append(self.walks, np.zeros(12))
        columns = INPUTS + len(self.P) - N
        self.F, self.G, self.Q = np.empty((9, 9)), np.empty((9, columns)), np.empty((9, 9))

    def go(self, start, stop):
        """The count of steps."""
        noise = noise_of(self.config)
        noise[1, 3, 1] = self.full_scale
        steps = transit(  # type: ignore[call-arg]
            self.x,
            self.R,
            self.R_ic,
            self.F,
            self.G,
            self.Q,
            (start, stop),
            *self.body,
            *self.phone,
            noise,
            forecast_after(self.phone) if self.predicts else NOTHING,
            np.empty((13, 3, 3)),
            self.tone,
        )
        work = np.empty((2, 9, len(self.P)))
        apply(self.P, self.F, self.G, self.Q, self.walks, stop - start, work)
        return steps

    def sigma(self, k):
        return np.sqrt(np.diag(self.P)[k : k + 3].max())
