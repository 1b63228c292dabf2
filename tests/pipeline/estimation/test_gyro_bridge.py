"""GyroBridge: through a gap of the phone's sensors the robot's gyroscope keeps f where it was."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.attitude import LOST_S, Attitude
from pipeline.estimation.gyro_bridge import DRIFT, GyroBridge
from pipeline.frames import GRAVITY, Array, exp, log
from pipeline.signals import PhoneImu, RelativeState

H = 0.005
STILL = np.zeros(3)
UP = np.array([0.0, 0.0, GRAVITY])
RATE_B = np.array([0.3, -0.2, 0.5])
TURN_C = exp(np.array([0.15, -0.2, 0.3]))
"""What the phone turns in the gap; nobody feels it."""


def relative(t: float, R_cb: Array, sigma_theta: float = 0.002) -> RelativeState:
    zero = np.zeros(3)
    return RelativeState(
        t, zero, R_cb, zero, RATE_B, zero, np.eye(3), 0.0, sigma_theta, 0.0, zero, zero
    )


class Gap:
    """Heard for 5 s, then not; the robot turns all the time."""

    def __init__(self) -> None:
        self.attitude, self.bridge = Attitude(), GyroBridge()
        self.t, self.R_fc, self.R_fb, self.R_cb = 0.0, np.eye(3), np.eye(3), np.eye(3)
        self.found: Array | None = None
        self.run(5.0)

    def run(self, seconds: float, *, heard: bool = True, sigma_theta: float = 0.002) -> None:
        for _ in range(round(seconds / H)):
            self.t = round(self.t + H, 9)
            self.R_fb = self.R_fb @ exp(RATE_B * H)
            if heard:
                self.attitude.add(PhoneImu(self.t, STILL, self.R_fc.T @ UP))
            self.R_cb = self.R_fc.T @ self.R_fb
            state = relative(self.t, self.R_cb, sigma_theta)
            self.found = self.bridge.step(self.attitude, state, H)

    def error(self) -> float:
        assert self.found is not None
        return float(np.linalg.norm(log(self.found.T @ self.R_fc)))


def test_a_turn_of_the_phone_in_a_gap_is_known_once_the_robot_is_seen_again() -> None:
    gap = Gap()
    before = gap.attitude.sigma
    gap.R_fc = gap.R_fc @ TURN_C
    gap.run(0.5, heard=False)
    gap.run(H)
    assert gap.error() < 2e-3
    assert before < gap.attitude.sigma < before + 2.0 * DRIFT * 0.5
    gap.run(1.0)
    assert gap.error() < 2e-3


def test_until_then_it_is_as_unsure_as_the_relative_attitude() -> None:
    gap = Gap()
    gap.run(0.5, heard=False, sigma_theta=0.1)
    gap.run(0.2, sigma_theta=0.1)
    assert gap.attitude.sigma > 0.1
    gap.run(0.1)
    assert gap.attitude.sigma < 0.06


def test_without_the_robots_gyroscope_the_phones_own_sensors_are_all_there_is() -> None:
    gap = Gap()
    gap.R_fc = gap.R_fc @ TURN_C
    gap.run(0.3, heard=False)
    gap.bridge.reset()
    gap.run(0.2, heard=False)
    gap.run(H)
    assert gap.error() > 0.1
    assert gap.attitude.sigma > 0.1


def test_a_robot_not_seen_again_is_not_believed_for_ever() -> None:
    gap = Gap()
    gap.run(0.5, heard=False, sigma_theta=0.3)
    gap.run(LOST_S - 0.6, sigma_theta=0.3)
    assert gap.attitude.sigma == pytest.approx(np.hypot(0.05, 0.3), rel=0.1)
    gap.run(1.1, sigma_theta=0.3)
    assert gap.attitude.sigma < 0.1


def test_before_the_phones_first_sample_nothing_is_known() -> None:
    assert GyroBridge().step(Attitude(), relative(1.0, np.eye(3)), H) is None
