"""Where a robot that hangs is, by what pulls it back: right at once and right for minutes."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from math import exp as exp_of

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.control.place import SuspendedPlace
from pipeline.control.push import PUSH_STAYS_S
from pipeline.frames import GRAVITY, Array, exp

ROBOT = load_robot("ames").robot
ZERO = np.zeros(3)
UP, H, LAG_S = np.array([0.0, 0.0, GRAVITY]), 0.005, 0.04


class Swing:
    """A mass on springs, pushed by thrusters that lag; what it feels goes to `SuspendedPlace`."""

    def __init__(
        self,
        bias: Array,
        R_fb: Array,
        gain: float = 1.0,
        lag_s: float = LAG_S,
        delay_ticks: int = 0,
    ) -> None:
        self.place = SuspendedPlace(ROBOT)
        self.x, self.v, self._thrust = np.zeros(3), np.zeros(3), np.zeros(3)
        self._bias, self._R_fb, self._gain, self._lag_s = bias, R_fb, gain, lag_s
        self._commanded = deque([ZERO] * (delay_ticks + 1), maxlen=delay_ticks + 1)

    def step(self, force_in_f: Array, touched_in_f: Array = ZERO) -> None:
        self._commanded.append(force_in_f)
        commanded = self._gain * self._commanded[0]
        self._thrust = self._thrust + H / self._lag_s * (commanded - self._thrust)
        pull = -ROBOT.stiffness_in_f * self.x - ROBOT.damping_in_f * self.v
        a = (self._thrust + pull + touched_in_f) / ROBOT.mass
        self.v = self.v + H * a
        self.x = self.x + H * self.v
        f_bf_in_b = self._R_fb.T @ (a + UP) + self._bias
        force_in_b = self._R_fb.T @ force_in_f
        self.place.propagate(f_bf_in_b, self._R_fb, force_in_b, H, True)


BIAS, R_FB = np.array([0.3, -0.2, 0.1]), exp(np.array([0.05, -0.1, 0.7]))


def test_a_hands_motion_is_known_to_a_tenth_though_the_accelerometer_is_off() -> None:
    swing, errors, rates, sizes = Swing(BIAS, R_FB), [], [], []
    for k in range(round(40.0 / H)):
        t = k * H
        if k == round(10.0 / H):
            swing.place.start()
            x_start = swing.x
        swing.step(np.array([1.5, 1.0, 2.0]) * np.sin(2.0 * np.pi * np.array([0.3, 0.2, 0.4]) * t))
        if t >= 12.0:
            errors.append(swing.place.x_in_f - (swing.x - x_start))
            rates.append(swing.place.v_in_f - swing.v)
            sizes.append((*swing.x, *swing.v))
    size = np.std(sizes, axis=0)
    assert (np.std(errors, axis=0) < 0.1 * size[:3]).all()
    assert (np.std(rates, axis=0) < 0.1 * size[3:]).all()


@pytest.mark.parametrize("seconds", [3.0, 60.0])
def test_a_place_that_is_kept_is_known_after_a_minute_as_after_seconds(seconds: float) -> None:
    swing = Swing(BIAS, R_FB)
    for _ in range(round(8.0 / H)):
        swing.step(np.zeros(3))
    swing.place.start()
    for _ in range(round(seconds / H)):
        swing.step(np.array([2.6, -1.3, 2.1]))
    np.testing.assert_allclose(swing.place.x_in_f, swing.x, atol=0.004)
    np.testing.assert_allclose(swing.place.v_in_f, swing.v, atol=0.01)
    assert swing.x[0] > 0.08


def test_thrusters_that_give_less_than_told_make_it_as_much_too_large() -> None:
    swing = Swing(np.zeros(3), np.eye(3), gain=0.9)
    for _ in range(round(20.0 / H)):
        swing.step(np.array([2.6, 0.0, 0.0]))
    assert swing.place.x_in_f[0] == pytest.approx(swing.x[0] / 0.9, rel=0.01)


def test_each_start_counts_from_there() -> None:
    swing = Swing(BIAS, R_FB)
    for _ in range(400):
        swing.step(np.array([2.0, 0.0, 0.0]))
    swing.place.start()
    np.testing.assert_array_equal(swing.place.x_in_f, np.zeros(3))


def test_a_robot_that_nothing_pulls_back_is_said_to_stay() -> None:
    place = SuspendedPlace(replace(ROBOT, stiffness_in_f=np.zeros(3)))
    for _ in range(2000):
        place.propagate(UP + BIAS, np.eye(3), np.ones(3), H, True)
    assert np.abs(place.x_in_f).max() < 0.2


def test_a_knock_is_told_from_thrust_and_swing() -> None:
    swing = Swing(BIAS, R_FB)
    for k in range(round(20.0 / H)):
        swing.step(np.array([1.5, 1.0, 2.0]) * np.sin(2.0 * np.pi * 0.4 * k * H))
        assert k * H < 8.0 or not swing.place.is_pushed
    for _ in range(10):
        knock = R_FB.T @ np.array([-10.0 / ROBOT.mass, 0.0, 0.0])
        swing.place.propagate(R_FB.T @ UP + BIAS + knock, R_FB, np.zeros(3), H, True)
    assert swing.place.is_pushed


def swung(force_n: float = 8.0) -> Swing:
    """One that swings with a hand, and whose thrusters, late in their own way, are commanded
    steps."""
    swing = Swing(BIAS, R_FB, lag_s=0.025, delay_ticks=3)
    for k in range(round(16.0 / H)):
        hand = np.array([1.5, 1.0, 2.0]) * np.sin(2.0 * np.pi * 0.4 * k * H)
        swing.step(hand + force_n * (k * H % 4.0 > 3.0) * np.array([0.6, -0.8, 0.0]))
        assert k * H < 8.0 or swing.place.is_known
    return swing


def test_steps_of_its_own_thrust_are_no_touch() -> None:
    assert swung().place.is_known


@pytest.mark.parametrize("touch_n", [3.0, 4.0, 8.0])
@pytest.mark.parametrize("lasts_s", [0.4, 20.0])
def test_whoever_touches_it_moves_neither_its_place_nor_its_speed(
    touch_n: float, lasts_s: float
) -> None:
    """As long as it lasts, and once it is let go: not by what that push over K would be."""
    swing, touched = swung(), np.array([0.0, -touch_n, 0.0])
    up, answer = np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.5 * touch_n, 0.5])
    for _ in range(800):
        swing.step(up)
    away, off, known = [], [], []
    for k in range(round((lasts_s + 6.0) / H)):
        swing.step(answer if 0.1 < k * H < lasts_s else up, touched if k * H < lasts_s else ZERO)
        away.append(float(np.linalg.norm(swing.place.from_rest_in_f - swing.x)))
        off.append(float(np.linalg.norm(swing.place.v_in_f - swing.v)))
        known.append(swing.place.is_steady)
    forgotten = 1.0 - exp_of(-lasts_s / PUSH_STAYS_S)
    assert max(away) < (0.2 + forgotten) * touch_n / ROBOT.stiffness_in_f[1]
    assert max(off) < 0.08
    assert not all(known)
    assert known[-1]


def test_it_stays_under_a_push_by_the_force_it_names() -> None:
    swing, touched = swung(), np.array([0.0, -3.0, 0.0])
    for _ in range(round(3.0 / H)):
        swing.step(ZERO, touched)
    due_in_f = swing.x
    for _ in range(round(8.0 / H)):
        swing.step(swing.place.force_to_stay_in_f(due_in_f - swing.x), touched)
    np.testing.assert_allclose(swing.x, due_in_f, atol=0.02)


def test_a_push_that_grows_slowly_is_taken_for_a_place() -> None:
    """Nothing tells it from one: what pulls for ever."""
    swing = swung()
    for k in range(round(20.0 / H)):
        swing.step(ZERO, np.array([0.0, -3.0 * min(1.0, k * H / 10.0), 0.0]))
    taken_m = 3.0 / ROBOT.stiffness_in_f[1]
    assert swing.place.from_rest_in_f[1] - swing.x[1] == pytest.approx(taken_m, rel=0.15)


def test_a_robot_that_stands_is_never_known_by_what_pulls_it_back() -> None:
    place = SuspendedPlace(replace(ROBOT, stiffness_in_f=np.zeros(3)))
    for _ in range(2000):
        place.propagate(UP, np.eye(3), np.zeros(3), H, True)
    assert not place.is_known


def test_the_way_from_its_rest_is_known_though_the_accelerometer_is_off() -> None:
    swing = Swing(BIAS, R_FB)
    for _ in range(round(8.0 / H)):
        swing.step(np.zeros(3))
    for press_s in (1.0, 6.0):
        swing.place.start()
        for _ in range(round(press_s / H)):
            swing.step(np.array([2.6, -1.3, 2.1]))
    np.testing.assert_allclose(swing.place.from_rest_in_f, swing.x, atol=0.004)


@pytest.mark.parametrize("gain", [1.0, 0.85])
def test_it_stays_by_the_force_it_names_though_thrusters_give_less(gain: float) -> None:
    swing = Swing(BIAS, R_FB, gain)
    for _ in range(round(8.0 / H)):
        swing.step(np.zeros(3))
    for _ in range(round(6.0 / H)):
        swing.step(np.array([2.6, -1.3, 2.1]))
    away_in_f = np.array([-0.02, 0.03, 0.04])
    due_in_f = swing.x + away_in_f
    force_in_f = swing.place.force_to_stay_in_f(away_in_f / gain)  # as far as it takes it to be
    for _ in range(round(12.0 / H)):
        swing.step(force_in_f)
    np.testing.assert_allclose(swing.x, due_in_f, atol=0.006)


@pytest.mark.parametrize("again_s", [0.5, 3.0])
def test_what_a_drifting_vertical_says_of_its_rest_is_not_learnt(again_s: float) -> None:
    """Six degrees off, as after ten seconds without a phone; then it is right again."""
    swing = Swing(BIAS, R_FB)
    for _ in range(round(4.0 / H)):
        swing.step(np.zeros(3))
    for _ in range(round(10.0 / H)):
        R_fb, f_bf_in_b = exp(np.array([0.1, 0.0, 0.0])) @ R_FB, R_FB.T @ UP + BIAS
        swing.place.propagate(f_bf_in_b, R_fb, np.zeros(3), H, False)
    for _ in range(round(again_s / H)):
        swing.step(np.zeros(3))
    for _ in range(round(2.0 / H)):
        swing.step(np.array([2.0, 0.0, 0.0]))
    np.testing.assert_allclose(swing.place.from_rest_in_f, swing.x, atol=0.005)


def test_what_an_attitude_far_from_upright_says_of_its_rest_is_not_learnt() -> None:
    """Thirty degrees off for seconds, and nobody knows it: a phone's gyroscope missed a turn."""
    swing = Swing(BIAS, R_FB)
    for _ in range(round(1.0 / H)):
        swing.step(np.zeros(3))
    for _ in range(round(3.0 / H)):
        R_fb, f_bf_in_b = exp(np.array([0.5, 0.0, 0.0])) @ R_FB, R_FB.T @ UP + BIAS
        swing.place.propagate(f_bf_in_b, R_fb, np.zeros(3), H, True)
    for _ in range(round(3.0 / H)):
        swing.step(np.zeros(3))
    for _ in range(round(2.0 / H)):
        swing.step(np.array([2.0, 0.0, 0.0]))
    np.testing.assert_allclose(swing.place.from_rest_in_f, swing.x, atol=0.006)
