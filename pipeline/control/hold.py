"""Control without camera and phone: the gyroscope keeps the attitude, force or momentum goes."""

from __future__ import annotations

from math import exp as exponential

import numpy as np

from pipeline.config import HoldConfig
from pipeline.frames import Array, exp, log
from pipeline.robot import Robot


class Hold:
    """Started from what tracking did last; needs no picture and no phone.

    A robot that hangs is carried, so its force bleeds off. Another keeps the force it needs to stay
    where it is (never more than its weight: it may sink, it must not rise), and one that takes from
    it the momentum it had; where it then is nobody knows.
    """

    def __init__(self, config: HoldConfig, robot: Robot) -> None:
        """Nothing to hold yet but the weight."""
        self._config, self._axes = config, robot.axes
        self._Kp = config.stiffness * robot.axes[3:] * robot.inertia
        self._Kd = config.damping * robot.axes[3:] * robot.inertia
        self._hangs, self._mass, self._weight = robot.hangs, robot.mass, robot.weight_to_carry
        self._lasting_force_in_f = np.array([0.0, 0.0, robot.weight_to_carry])
        self._fading_force_in_f = np.zeros(3)
        self._gyro_bias_in_b = self._accelerometer_bias_in_b = np.zeros(3)
        self.R_fb: Array = np.eye(3)
        """Attitude, carried on by the gyroscope."""
        self._R_fb_held = np.eye(3)

    def learn(self, gyro_bias_in_b: Array, accelerometer_bias_in_b: Array, h: float) -> None:
        """While tracking: what both are wrong by (3,) [rad/s], (3,) [m/s²], smoothed here."""
        share = h / (h + self._config.learn_s)
        self._gyro_bias_in_b = self._gyro_bias_in_b + share * (
            gyro_bias_in_b - self._gyro_bias_in_b
        )
        self._accelerometer_bias_in_b = self._accelerometer_bias_in_b + share * (
            accelerometer_bias_in_b - self._accelerometer_bias_in_b
        )

    def specific_force_in_b(self, a_m_bf_in_b: Array) -> Array:
        """Specific force (3,) [m/s²] of a sample, by the bias that was learnt while tracking."""
        return a_m_bf_in_b - self._accelerometer_bias_in_b

    def start(
        self, force_in_b: Array, R_fb: Array, v_bf_in_f: Array, learnt_force_in_f: Array
    ) -> None:
        """Take over from tracking.

        Args:
            force_in_b: What it gave last (3,) [N].
            R_fb: Attitude.
            v_bf_in_f: Velocity (3,) [m/s].
            learnt_force_in_f: What it found to need without any error (3,) [N].
        """
        self.R_fb = self._R_fb_held = R_fb
        if self._hangs:
            self._fading_force_in_f = R_fb @ force_in_b
            return
        self._fading_force_in_f = -self._mass / self._config.brake_s * v_bf_in_f
        least, most = self._config.least_share * self._weight, self._weight
        aside = (most - least) / 2.0
        self._lasting_force_in_f = np.clip(
            learnt_force_in_f, (-aside, -aside, least), (aside, aside, most)
        )

    def wrench(self, omega_m_bf_in_b: Array, h: float) -> Array:
        """Force and torque in b (6,) after another `h` seconds; none on axes let alone."""
        fade_s = self._config.bleed_s if self._hangs else self._config.brake_s
        omega_bf_in_b = omega_m_bf_in_b - self._gyro_bias_in_b
        self.R_fb = self.R_fb @ exp(omega_bf_in_b * h)
        self._fading_force_in_f = self._fading_force_in_f * exponential(-h / fade_s)
        force_in_f = self._lasting_force_in_f + self._fading_force_in_f
        torque_in_b = self._Kp * log(self.R_fb.T @ self._R_fb_held) - self._Kd * omega_bf_in_b
        return np.concatenate((self._axes[:3] * (self.R_fb.T @ force_in_f), torque_in_b))
