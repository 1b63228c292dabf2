"""Keeping station through a gap: a second of dead reckoning by the robot's own motion sensors.

The estimate is relative to the phone, and whether a phone that is silent goes on or stops nobody
knows. The robot's own acceleration is known throughout: its velocity in f is that, integrated and
high-passed (a hand never goes on in one direction), and through a gap so is its place. A robot that
hangs knows both ten times better, by what pulls it back (`place`). The paper's PD law brakes it and
keeps it there.
"""

from __future__ import annotations

from math import exp as exponential

import numpy as np

from pipeline.config import StationConfig
from pipeline.control import low_pass
from pipeline.control.feedforward import G_IN_F
from pipeline.control.pid import PoseError
from pipeline.frames import Array
from pipeline.gains import Gains
from pipeline.robot import Robot
from pipeline.signals import VirtualView


class StationKeeping:
    """Call `propagate` every period, `start` when a gap is noticed, `force_in_b` while it lasts."""

    def __init__(self, config: StationConfig, gains: Gains, robot: Robot) -> None:
        """At rest."""
        self._config, self._axes = config, robot.axes[:3]
        self._Kp, self._Kd = self._axes * gains.Kp[:3], self._axes * gains.Kd[:3]
        self._a_slow_in_f, self._averaged_s = np.zeros(3), 0.0
        self._integrated_in_f: Array = np.zeros(3)  # high-passed: what is known without anybody
        self.v_in_f: Array = np.zeros(3)
        """Velocity of the body [m/s]."""
        self._offset_in_f, self._constant_force_in_f = np.zeros(3), np.zeros(3)

    def propagate(
        self, f_bf_in_b: Array, R_fb: Array, h: float, known: tuple[Array, Array] | None = None
    ) -> None:
        """Carry velocity and place on.

        Args:
            f_bf_in_b: Specific force (3,) [m/s²].
            R_fb: Attitude of the body.
            h: Since the last call [s].
            known: What somebody knows better: how far the body moved since (3,) [m], and how fast
                it is (3,) [m/s].
        """
        a_in_f = R_fb @ f_bf_in_b + G_IN_F
        # a mean at first: an offset must not count as speed until the high pass has forgotten it
        self._averaged_s += h
        share = max(low_pass.share(h / self._config.bias_s), h / self._averaged_s)
        self._a_slow_in_f = self._a_slow_in_f + share * (a_in_f - self._a_slow_in_f)
        v_in_f = self._integrated_in_f + h * (a_in_f - self._a_slow_in_f)
        self._integrated_in_f = v_in_f * exponential(-h / self._config.rest_s)
        moved_in_f, self.v_in_f = known or (h * self._integrated_in_f, self._integrated_in_f)
        self._offset_in_f = self._offset_in_f - moved_in_f

    def start(self, offset_in_f: Array, constant_force_in_f: Array) -> None:
        """Stop at the place that is `offset_in_f` (3,) [m] away.

        Args:
            offset_in_f: From the body to where it is to stay.
            constant_force_in_f: What it takes to stay anywhere near (3,) [N].
        """
        self._offset_in_f, self._constant_force_in_f = offset_in_f, constant_force_in_f

    def reset(self) -> None:
        """Begin again after a gap of samples: where it is now is as good as any place."""
        self._integrated_in_f = self.v_in_f = self._offset_in_f = np.zeros(3)

    def turn(self, turn_of_f: Array) -> None:
        """The axes of f were put right by (3, 3), or begin anew by another phone's."""
        self._a_slow_in_f = turn_of_f @ self._a_slow_in_f
        self._integrated_in_f = turn_of_f @ self._integrated_in_f
        self.v_in_f, self._offset_in_f = turn_of_f @ self.v_in_f, turn_of_f @ self._offset_in_f

    def error(self, view: VirtualView) -> PoseError:
        """To the place where it is to stay; its attitude is the gyroscope's own."""
        return PoseError(
            view.R_fv.T @ self._offset_in_f, -view.R_fv.T @ self.v_in_f, np.zeros(3), np.zeros(3)
        )

    def force_in_b(self, R_fb: Array) -> Array:
        """Force in b (3,) [N]; none on axes let alone."""
        return (
            self._Kp * (R_fb.T @ self._offset_in_f)
            - self._Kd * (R_fb.T @ self.v_in_f)
            + self._axes * (R_fb.T @ self._constant_force_in_f)
        )
