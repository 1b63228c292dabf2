"""A simulated robot that keeps an attitude by itself: an autopilot between a set-point and `Plant`.

Cascaded as autopilots are: attitude to rates, rates to torques, those and the thrust to motors. Its
vertical is off by an angle of its own, and it knows its propellers' thrust as badly as anybody who
has read their data sheet. It follows roll, pitch and a yaw rate, whatever its heading.
"""

from __future__ import annotations

from collections import deque
from math import radians
from typing import Final

import numpy as np

from hardware.follower import LIFT
from hardware.plant_parameters import PlantParameters
from hardware.robot_physics import allocation_matrix
from hardware.sim.plant.plant import Plant, PlantOptions
from pipeline.frames import Array, R_from_rpy, exp, log, rpy_from_R
from pipeline.robot import AttitudeDrive, lift_mixer

QUICKER: Final = 4.0
"""Gain of the rates to that of the attitude: two equal lags, without overshoot."""
LEVEL_SIGMA: Final = radians(0.5)
"""Of its vertical about x and y [rad]: chosen, a calibration on a table that seems level."""
THRUST_SIGMA: Final = 0.05
"""Share by which it gives another thrust than told: chosen, battery and air."""


class AttitudePlant(Plant):
    """A `Plant` that is told roll, pitch [rad], yaw rate [rad/s] and thrust [N]."""

    def __init__(
        self,
        parameters: PlantParameters,
        drive: AttitudeDrive,
        rng: np.random.Generator,
        options: PlantOptions | None = None,
    ) -> None:
        """At rest, thrusters off."""
        super().__init__(parameters, rng, options)
        own = rng.spawn(1)[0]  # all else stays as it would be
        off = LEVEL_SIGMA * own.standard_normal(2)
        self._R_off = exp(np.array([off[0], off[1], 0.0]))
        self._scale = 1.0 + THRUST_SIGMA * float(own.standard_normal())
        A = allocation_matrix(
            parameters.thruster_positions_in_b,
            parameters.thruster_directions_in_b,
            parameters.thruster_torques,
        )
        self._mixer = lift_mixer(A)
        self._attitude_gain = 1.0 / drive.lag_s
        self._rate_gains = np.array([*2 * (QUICKER / drive.lag_s,), 1.0 / drive.yaw_lag_s])
        self._thrust = 0.0
        self._leans: deque[Array] = deque(maxlen=1 + round(drive.delay_s / 0.005))

    def step(self, told: Array, dt: float = 0.005) -> None:
        """Go on by `dt` [s], whole milliseconds, with a new set-point (4,)."""
        self._leans.append(told[: LIFT.start])
        self._thrust = float(told[LIFT][0])
        super().step(self._motors(*self._leans[0].tolist()), dt)

    @property
    def given(self) -> Array:
        """What it reports of itself: thrusts (m,) for what it is told, as if it were level."""
        return self._mixer[:, 0] * self._thrust

    def _motors(self, roll: float, pitch: float, yaw_rate: float) -> Array:
        """Thrusts (m,) [N] for a set-point: none without a thrust, whose delay is the motors'."""
        if self._thrust <= 0.0:
            return np.zeros(self._mixer.shape[0])
        R_fb = self.R_fb @ self._R_off  # by its own vertical
        _, _, yaw = rpy_from_R(R_fb)
        left = log(R_fb.T @ R_from_rpy(np.array([roll, pitch, yaw])))
        rates = self._attitude_gain * left
        rates[2] = yaw_rate
        torque = self.parameters.inertia * self._rate_gains * (rates - self.omega_bf_in_b)
        level = self._scale * self.given
        turning = self._mixer[:, 1:] @ torque
        # a motor that can't give all of it: less torque, before less thrust
        room = np.where(turning < 0.0, level, self.parameters.f_max - level)
        tight = np.abs(turning) > room
        share = float((room[tight] / np.abs(turning[tight])).min(initial=1.0))
        motors: Array = level + max(0.0, share) * turning
        return motors
