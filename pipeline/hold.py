"""Control without the camera: the gyroscope keeps the attitude, the force bleeds off."""

from __future__ import annotations

from math import exp as exponential

import numpy as np

from pipeline.config import HoldConfig
from pipeline.frames import Array, exp, log


class Hold:
    """Started from the last wrench and attitude of tracking; needs no picture and no phone."""

    def __init__(self, config: HoldConfig) -> None:
        """Nothing to hold yet."""
        self._config = config
        self._force_in_f = np.zeros(3)
        self._R_fb = np.eye(3)
        self._R_fb_held = np.eye(3)

    def start(self, force_in_b: Array, R_fb: Array) -> None:
        """Take over from tracking."""
        self._force_in_f = R_fb @ force_in_b
        self._R_fb = self._R_fb_held = R_fb

    def wrench(self, omega_bf_in_b: Array, h: float) -> Array:
        """Force and torque in b (6,) after another `h` seconds."""
        config = self._config
        self._R_fb = self._R_fb @ exp(omega_bf_in_b * h)
        self._force_in_f = self._force_in_f * exponential(-h / config.bleed_s)
        torque_in_b = config.Kp * log(self._R_fb.T @ self._R_fb_held) - config.Kd * omega_bf_in_b
        return np.concatenate((self._R_fb.T @ self._force_in_f, torque_in_b))
