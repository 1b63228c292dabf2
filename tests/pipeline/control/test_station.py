"""Station keeping: a second of dead reckoning that brakes and stays."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import StationConfig
from pipeline.control.station import StationKeeping
from pipeline.frames import GRAVITY, Array, exp
from pipeline.gains import PHONE

ROBOT = load_robot("ames").robot
UP = np.array([0.0, 0.0, GRAVITY])
H = 0.005


def station() -> StationKeeping:
    return StationKeeping(StationConfig(), PHONE, ROBOT)


def swayed(seconds: float, bias: Array) -> tuple[StationKeeping, Array, Array]:
    """One that has swayed with a hand at 0.3 Hz, 10 cm; its true velocity and place."""
    keeps, omega = station(), 2.0 * np.pi * 0.3
    for k in range(round(seconds / H)):
        a = np.array([0.0, -0.1 * omega**2 * np.sin(omega * k * H), 0.0])
        keeps.propagate(UP + a + bias, np.eye(3), H)
    v = np.array([0.0, 0.1 * omega * np.cos(omega * seconds), 0.0])
    return keeps, v, np.zeros(3)


def test_a_moving_robot_is_braked_within_centimetres_and_stays() -> None:
    keeps, v, x = swayed(20.0, bias=np.array([0.0, 0.02, 0.0]))
    assert np.linalg.norm(v) > 0.15
    keeps.start(np.zeros(3), np.zeros(3))
    farthest = 0.0
    for _ in range(round(1.0 / H)):
        a = keeps.force_in_b(np.eye(3)) / ROBOT.mass
        keeps.propagate(UP + a + (0.0, 0.02, 0.0), np.eye(3), H)
        v, x = v + H * a, x + H * v
        farthest = max(farthest, float(np.linalg.norm(x)))
    assert farthest < 0.05
    assert np.linalg.norm(v) < 0.05


def test_a_sensor_offset_is_no_speed_however_short_it_has_been_felt() -> None:
    f_bf_in_b = UP + np.array([0.0, 0.2, -0.1])
    for seconds in (0.1, 1.0, 3.0, 10.0):
        keeps = station()
        for _ in range(round(seconds / H)):
            keeps.propagate(f_bf_in_b, np.eye(3), H)
        assert np.linalg.norm(keeps.v_in_f) < 0.002


def test_at_rest_it_asks_for_nothing_but_what_it_takes_to_stay_in_any_attitude() -> None:
    keeps, force_in_f = station(), np.array([1.0, -2.0, 3.0])
    for R_fb in (np.eye(3), exp(np.array([0.1, -0.2, 0.3]))):
        keeps.start(np.zeros(3), force_in_f)
        for _ in range(200):
            keeps.propagate(R_fb.T @ UP, R_fb, H)
        np.testing.assert_allclose(R_fb @ keeps.force_in_b(R_fb), force_in_f, atol=1e-9)


def test_it_goes_to_the_place_it_is_given() -> None:
    keeps = station()
    keeps.start(np.array([0.05, 0.0, 0.0]), np.zeros(3))
    assert keeps.force_in_b(np.eye(3))[0] == pytest.approx(0.05 * PHONE.Kp[0])


def test_what_is_known_better_is_taken_and_the_rest_is_there_when_it_ends() -> None:
    keeps, twin = station(), station()
    v_in_f, felt = np.array([0.1, 0.0, -0.2]), UP + np.array([0.3, 0.0, 0.0])
    keeps.start(np.zeros(3), np.zeros(3))
    for _ in range(20):
        keeps.propagate(felt, np.eye(3), H, (H * v_in_f, v_in_f))
        twin.propagate(felt, np.eye(3), H)
    np.testing.assert_array_equal(keeps.v_in_f, v_in_f)
    expected = -20 * H * PHONE.Kp[:3] * v_in_f - PHONE.Kd[:3] * v_in_f
    np.testing.assert_allclose(keeps.force_in_b(np.eye(3)), expected)
    keeps.propagate(felt, np.eye(3), H)
    twin.propagate(felt, np.eye(3), H)
    np.testing.assert_array_equal(keeps.v_in_f, twin.v_in_f)


def test_who_felt_nothing_for_a_while_stays_where_he_is() -> None:
    keeps, _, _ = swayed(5.0, bias=np.zeros(3))
    keeps.start(np.array([0.05, 0.0, 0.0]), np.zeros(3))
    keeps.reset()
    np.testing.assert_array_equal(keeps.force_in_b(np.eye(3)), np.zeros(3))
