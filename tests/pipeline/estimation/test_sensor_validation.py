"""Gravity test: each fault of a phone's motion sensors is named, a good phone passes at once."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation import sensor_validation
from pipeline.estimation.rate_axes import WAYS, RateAxes, words
from pipeline.estimation.sensor_validation import SensorValidation
from pipeline.estimator_config import GravityTestConfig
from pipeline.frames import GRAVITY, R_cd, exp, log, rotation_about_x

DT = 1.0 / 60.0
UP = np.array([0.0, 0.0, 1.0])
R_FB = exp(np.array([0.05, -0.1, 2.0]))
"""The robot hangs a little askew."""


def same(v):
    return v


class Phone:
    """In a hand that looks `pitch` downwards; what it says passes through `rate` and `force`."""

    def __init__(self, rate=same, force=same, told=None, screen=90, pitch=0.2):
        self.test = SensorValidation(GravityTestConfig())
        self.rate, self.force, self.pitch = rate, force, pitch
        self.screen, self.told = screen, screen if told is None else told
        self.t = 0.0

    def pose(self, t):
        """R_fc: level, but for the pitch."""
        return exp(np.array([0.0, self.pitch, 0.0]))

    def omega_in_c(self, t, h=1e-4):
        return log(self.pose(t - h).T @ self.pose(t + h)) / (2.0 * h)

    def listen(self, seconds, poses=True, noise=0.0, rng=None):
        rng = rng or np.random.default_rng(0)
        for k in range(round(seconds / DT)):
            R_fc, R_dc = self.pose(self.t), R_cd(self.screen).T
            force = R_dc @ (GRAVITY * R_fc[2]) + noise * rng.normal(size=3)
            rate = R_dc @ self.omega_in_c(self.t)
            self.test.add_body(self.t, np.zeros(3))
            self.test.add_motion(self.t, self.rate(rate), self.force(force), self.told)
            if poses and k % 2 == 0:
                self.test.add_pose(self.t, R_fc.T @ R_FB, R_FB.T @ UP)
            self.t += DT
        return self.test.faults()


class Waving(Phone):
    """Turns to and fro about all axes."""

    def pose(self, t):
        angles = 0.25 * np.sin(np.array([1.9, 2.6, 3.1]) * t)
        return exp(angles) @ super().pose(t)


def test_a_good_phone_passes_within_a_second_and_a_bit():
    phone = Phone()
    assert phone.listen(0.5) == [sensor_validation.WAIT]
    assert phone.listen(0.7) == []
    assert not phone.test.doubts_up


@pytest.mark.parametrize("screen", [0, 90, 180, 270])
def test_a_good_phone_passes_however_it_is_held_and_shaken(screen):
    assert Phone(screen=screen, pitch=-0.6).listen(2.0, noise=0.8) == []
    assert Waving(screen=screen).listen(8.0, noise=0.5) == []


def test_gravity_in_g_missing_and_of_another_size():
    assert Phone(force=lambda f: f / GRAVITY).listen(1.5) == [sensor_validation.G_UNITS]
    still = Phone(force=lambda f: f - R_cd(90).T @ (GRAVITY * Phone().pose(0.0)[2]))
    assert still.listen(1.5, noise=0.1) == [sensor_validation.NO_GRAVITY]
    (twice,) = Phone(force=lambda f: 2.0 * f).listen(1.5)
    assert "19.6 instead of 9.8" in twice


def test_what_is_mended_passes():
    phone = Phone(force=lambda f: f / GRAVITY)
    assert phone.listen(1.5) != []
    phone.force = same
    assert phone.listen(2.5) == []


@pytest.mark.parametrize("pitch", [0.3, -0.4])
def test_the_opposite_sign_is_named_when_the_camera_is_not_level(pitch):
    assert Phone(force=np.negative, pitch=pitch).listen(2.0) == [sensor_validation.SIGN]


def test_the_opposite_sign_or_a_picture_on_its_head_held_level_look_alike():
    assert Phone(force=np.negative, pitch=0.0).listen(2.0) == [sensor_validation.SIGN_OR_TURN]
    assert Phone(screen=270, told=90, pitch=0.0).listen(2.0) == [sensor_validation.SIGN_OR_TURN]


@pytest.mark.parametrize(("screen", "told"), [(90, 0), (0, 90), (270, 0), (270, 90), (0, 270)])
def test_a_wrong_screen_angle_is_named(screen, told):
    (fault,) = Phone(screen=screen, told=told, pitch=0.3).listen(2.0)
    assert f"told as {told}°, it is {screen}°" in fault


def test_an_accelerometer_with_other_axes_is_told():
    (fault,) = Phone(force=lambda f: f[[2, 0, 1]], pitch=0.8).listen(2.0)
    assert "axes are" in fault


def test_a_screen_turn_is_tested_anew():
    phone = Phone()
    assert phone.listen(1.5) == []
    phone.screen = phone.told = 0
    assert phone.listen(0.3) == [sensor_validation.WAIT]
    assert phone.listen(1.2) == []
    phone.screen = 90  # and a turn that the page did not tell
    phone.told = 180
    (fault,) = phone.listen(2.0)
    assert "it is 90°" in fault


def test_without_poses_nothing_is_said_of_up():
    assert Phone(force=np.negative).listen(2.0, poses=False) == []


def test_one_false_pose_does_not_condemn():
    phone = Phone()
    phone.listen(1.2, poses=False)
    phone.test.add_pose(phone.t, rotation_about_x(1.5), UP)
    assert phone.test.faults() == [sensor_validation.WAIT_UP]
    assert phone.listen(0.5) == []


@pytest.mark.parametrize("way", range(1, len(WAYS)))
def test_each_way_to_mix_up_the_gyroscopes_axes_is_named(way):
    M = WAYS[way]
    faults = Waving(rate=lambda omega: M.T @ omega).listen(6.0)
    assert faults == [sensor_validation.RATES.format(words=words(M))]


def test_mixed_axes_are_found_by_gravity_alone_while_the_robot_is_not_seen():
    def found(M):
        (fault,) = Waving(rate=lambda omega: M.T @ omega).listen(12.0, poses=False)
        return "axes mixed up" in fault

    order, negated = WAYS[[words(M) for M in WAYS].index("+y, +z, +x")], -np.eye(3)
    assert found(order)
    assert found(negated)


def test_a_hand_that_hardly_turns_decides_nothing():
    rates = RateAxes(GravityTestConfig())
    for k in range(600):
        rates.add(k * DT, np.array([0.0, 0.002, 0.0]), GRAVITY * UP)
    assert len(rates.possible) == len(WAYS)


def test_the_ways_are_all_and_the_names_say_what_arrives():
    assert len({tuple(M.ravel()) for M in WAYS}) == 48
    np.testing.assert_array_equal(WAYS[0], np.eye(3))
    assert words(WAYS[0]) == "+x, +y, +z"
    reported = np.array([2.0, 3.0, 1.0])  # of a turn (1, 2, 3): x brings y, y brings z
    named = [M for M in WAYS if np.array_equal(M @ reported, [1.0, 2.0, 3.0])]
    assert [words(M) for M in named] == ["+y, +z, +x"]
