"""An autopilot that takes attitude and thrust, as somebody else would write it: with pymavlink."""

from __future__ import annotations

import numpy as np

from pipeline.frames import R_from_wxyz, rpy_from_R
from tests.hardware.link.mavlink.lab_autopilot import FLIP, OFFBOARD, PERIOD_S, LabAutopilot

TIMEOUT_S = 0.06
DOWN = 0.998
"""Of its thrust that is left after each period without a set-point: its own way down."""


class LabCopter(LabAutopilot):
    """`body` is an `AttitudePlant`, which it tells what it has heard; 1 is a thrust of `most`."""

    def __init__(self, port, body, most, **others):
        super().__init__(port, body, None, **others)
        self.most, self.told = most, np.zeros(4)

    def take(self, message, now, stamp):
        super().take(message, now, stamp)
        if message.get_type() == "SET_ATTITUDE_TARGET":
            self.take_attitude(message, now)

    def take_attitude(self, said, now):
        assert said.type_mask == 1 + 2  # attitude, yaw rate and thrust
        assert (said.target_system, said.target_component) == (self.mav.srcSystem, 1)
        assert 0.0 <= said.thrust <= 1.0
        roll, pitch, yaw = rpy_from_R(R_from_wxyz(np.array(said.q)))
        _, _, heads = rpy_from_R(FLIP @ self.body.R_fb @ FLIP)
        assert abs(np.angle(np.exp(1j * (yaw - heads)))) < 0.05, "it would turn by it, too"
        told = np.array([roll, -pitch, -said.body_yaw_rate, self.most * said.thrust])
        self.taken.append((now, told))
        if self.custom_mode == OFFBOARD and self.armed:
            self.told, self.heard_at = told, now

    def step(self, now, stamp):
        self.listen(now, stamp)
        if now - self.heard_at > TIMEOUT_S:
            self.told = np.array([0.0, 0.0, 0.0, DOWN * self.told[3]])
        self.body.step(self.told, PERIOD_S)
        self.speak(stamp)

    def motion(self, stamp):
        R_na = FLIP @ self.body.R_fb @ FLIP
        omega, a = self.body.imu()
        imu = self.mav.highres_imu_encode(
            round(1e6 * stamp), *(FLIP @ a), *(FLIP @ omega), *7 * (0.0,), 0b111111
        )
        attitude = self.mav.attitude_encode(
            round(1e3 * stamp), *rpy_from_R(R_na), *(FLIP @ self.body.omega_bf_in_b)
        )
        return [attitude, imu]
