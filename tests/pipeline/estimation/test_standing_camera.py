"""A frame that stands: only while the phone does, and another one whenever it has moved."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.standing_camera import STANDS_S, StandingCamera
from pipeline.frames import R_from_rpy, exp
from pipeline.signals import PhoneImu, RelativePose

R_CS = R_from_rpy(np.array([0.1, -0.3, 0.0])).T
"""Of a phone on a tripod that looks up a little and leans."""
UP_IN_C = R_CS @ [0.0, 0.0, 9.81]
BODY_IN_C = np.array([2.0, 0.3, -0.1])


class Phone:
    def __init__(self, seed=0):
        self.camera, self.rng = StandingCamera(), np.random.default_rng(seed)
        self.t, self.number = 5.0, 0

    def stands(self, seconds, omega=(0.0, 0.0, 0.0), a=(0.0, 0.0, 0.0)):
        """With a phone's noise, rounding and bias."""
        for _ in range(round(60 * seconds)):
            self.t += 1.0 / 60.0
            gyro = np.round(self.rng.normal(0.003, 0.002, 3) + omega, 4)
            force = UP_IN_C + self.rng.normal(0.0, 0.03, 3) + 0.05 + a
            self.camera.add(PhoneImu(self.t, gyro, force, self.number))
        return self

    def sees(self, ago=0.15, covariance=None):
        cov = np.eye(6) if covariance is None else covariance
        pose = RelativePose(self.t - ago, BODY_IN_C, np.eye(3), cov, 0.1, 5)
        return self.camera.pose(pose, pose.t)


def test_on_a_tripod_it_is_the_pose_in_level_axes_at_the_time_of_the_picture():
    phone = Phone().stands(STANDS_S + 0.3)
    seen = phone.sees()
    assert seen.t == pytest.approx(phone.t - 0.15)
    level = seen.R_sb @ UP_IN_C / 9.81  # c is b here
    assert level == pytest.approx([0.0, 0.0, 1.0], abs=0.02)
    assert np.linalg.norm(seen.p_bs_in_s) == pytest.approx(np.linalg.norm(BODY_IN_C))
    assert seen.p_bs_in_s[2] == pytest.approx((R_CS.T @ BODY_IN_C)[2], abs=0.03)


def test_a_covariance_turns_with_the_place_and_not_with_the_body():
    covariance = np.diag([0.04, 1e-4, 1e-4, 1e-3, 2e-3, 3e-3])
    seen = Phone().stands(3.0).sees(covariance=covariance)
    along = seen.p_bs_in_s / np.linalg.norm(seen.p_bs_in_s)
    assert along @ seen.covariance[:3, :3] @ along == pytest.approx(0.04, rel=0.1)
    assert np.trace(seen.covariance[:3, :3]) == pytest.approx(0.0402)
    assert seen.covariance[3:, 3:] == pytest.approx(covariance[3:, 3:])


def test_it_has_to_stand_for_a_while_before_the_picture_and_to_be_felt_after_it():
    phone = Phone().stands(STANDS_S + 0.1)
    assert phone.sees(ago=0.15) is None
    assert phone.sees(ago=-0.01) is None
    assert phone.stands(0.2).sees(ago=0.15) is not None


def test_in_a_hand_there_is_none():
    """Trembling as hands that hold still do."""
    phone, rng, seen = Phone(), np.random.default_rng(3), []
    for _ in range(1000):
        tremor = 0.03 * np.sin(2 * np.pi * 4.0 * phone.t + rng.normal(0.0, 0.3, 3))
        seen.append(phone.stands(1 / 60, omega=tremor).sees())
    assert seen == 1000 * [None]


MOVED = {
    "turned": lambda phone: phone.stands(0.1, omega=(0.0, 0.2, 0.0)),
    "pushed": lambda phone: phone.stands(0.1, a=(0.5, 0.0, 0.0)),
    "another phone": lambda phone: setattr(phone, "number", 1),
    "not felt for a while": lambda phone: setattr(phone, "t", phone.t + 1.0),
    "leaning more and more": lambda phone: [
        phone.stands(0.1, a=UP_IN_C - exp(np.array([0.0, 2e-3 * k, 0.0])) @ UP_IN_C)
        for k in range(20)
    ],
}


@pytest.mark.parametrize("how", MOVED)
def test_when_it_has_moved_there_is_none_for_a_while_and_then_another_frame(how):
    phone = Phone().stands(3.0)
    first = phone.sees()
    assert phone.stands(0.5).sees().frame == first.frame
    MOVED[how](phone)
    phone.stands(0.5)
    assert phone.sees() is None
    phone.stands(3.0)
    assert phone.sees().frame == first.frame + 1
