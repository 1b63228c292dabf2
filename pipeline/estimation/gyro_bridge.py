"""The phone's attitude through a gap of its motion sensors, by way of the robot's gyroscope.

How the phone has turned meanwhile nobody felt, and its accelerometer says gravity only to as much
as the hand accelerates: 0.15 rad. But the robot felt all along how it turned itself, and how it is
turned to the phone the next picture tells. Until then, what of the phone's turn was guessed wrong
is wrong in both alike, and the robot's own attitude is right.
"""

from __future__ import annotations

from math import hypot, inf

from pipeline.estimation.attitude import LOST_S, Attitude
from pipeline.frames import Array, exp
from pipeline.imu_stream import MAX_GAP_S
from pipeline.signals import RelativeState

DRIFT = 0.01
"""Of the robot's attitude by its gyroscope, bias removed [rad/s]."""
SETTLED = 0.2
"""Of what the robot's attitude is unsure by: so much of the relative one adds little to it."""


class GyroBridge:
    """Call `step` every period; it corrects the phone's attitude after a gap."""

    def __init__(self) -> None:
        """No gap."""
        self._R_fb: Array | None = None
        self._sigma, self._t_heard = 0.0, -inf
        self._bridges = False

    def reset(self) -> None:
        """The robot's gyroscope, too, was not heard: nothing carries the attitude on."""
        self._R_fb, self._bridges = None, False

    def step(self, attitude: Attitude, relative: RelativeState, h: float) -> Array | None:
        """R_fc now (3, 3), or None before the phone's first sample; `h` [s] since the last step."""
        if attitude.R_fc is None:
            return None
        R_fc = attitude.R_fc @ relative.R_ic  # what carried p, R and u on: errors cancel
        silent = relative.t - attitude.t > MAX_GAP_S
        if self._bridges and relative.t - self._t_heard > LOST_S:
            self.reset()
        self._bridges = self._R_fb is not None and (self._bridges or silent)
        if not silent and not self._bridges and attitude.t > self._t_heard:
            self._R_fb = R_fc @ relative.R_cb
            self._sigma, self._t_heard = attitude.sigma, attitude.t
        elif self._R_fb is not None:
            self._R_fb = self._R_fb @ exp(relative.omega_bf_in_b * h)
            self._sigma += DRIFT * h
        if self._R_fb is None or not self._bridges:
            return R_fc
        R_fc = self._R_fb @ relative.R_cb.T
        if not silent:
            sigma = hypot(self._sigma, relative.sigma_theta)
            attitude.correct(R_fc @ relative.R_ic.T, sigma)
            self._bridges = relative.sigma_theta > SETTLED * self._sigma
        return R_fc
