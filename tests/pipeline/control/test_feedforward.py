"""Feed-forward: the force that the reference's motion takes, blind to biases, without a jump."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import FeedForwardConfig
from pipeline.control.feedforward import FeedForward
from pipeline.control.pid import Pid, Reference, pose_error
from pipeline.frames import GRAVITY, exp
from pipeline.gains import PHONE
from pipeline.robot import Robot
from pipeline.signals import RelativeState, VirtualView

H = 0.005
UP = np.array([0.0, 0.0, GRAVITY])
EYE, ZERO = np.eye(3), np.zeros(3)


def relative(f_cf_in_c: np.ndarray, f_bf_in_b: np.ndarray = UP) -> RelativeState:
    return RelativeState(
        t=0.0,
        p_bc_in_c=ZERO,
        R_cb=EYE,
        u_bf_in_c=ZERO,
        omega_bf_in_b=ZERO,
        omega_cf_in_c=ZERO,
        R_ic=EYE,
        sigma_p=0.0,
        sigma_theta=0.0,
        age=0.0,
        f_cf_in_c=f_cf_in_c,
        f_bf_in_b=f_bf_in_b,
    )


def view(p: np.ndarray = ZERO, v: np.ndarray = ZERO, omega: np.ndarray = ZERO) -> VirtualView:
    return VirtualView(EYE, omega, p, EYE, v, ZERO)


@pytest.fixture(scope="module")
def ames() -> Robot:
    return load_robot("ames").robot


def test_a_hand_that_swings_takes_mass_times_acceleration(ames: Robot) -> None:
    ahead, omega = FeedForward(ames, FeedForwardConfig()), 2.0 * pi * 0.5
    forces, wanted = [], []
    for k in range(4000):
        a = np.array([0.3, -0.2, 0.1]) * sin(omega * k * H)
        forces.append(ahead.wrench(relative(UP + a), EYE, view(), ZERO, H)[:3])
        wanted.append(ames.mass * a)
    error = np.array(forces[2000:]) - np.array(wanted[2000:])
    assert np.sqrt((error**2).mean()) < 0.35 * np.sqrt((np.array(wanted[2000:]) ** 2).mean())


def test_a_bias_or_a_wrong_vertical_leaves_no_force(ames: Robot) -> None:
    ahead = FeedForward(ames, FeedForwardConfig())
    tilted = exp(np.array([0.03, -0.02, 0.0])) @ UP + np.array([0.1, 0.05, -0.1])
    for _ in range(100):
        wrench = ahead.wrench(relative(tilted), EYE, view(), ZERO, H)
    np.testing.assert_allclose(wrench, np.zeros(6), atol=1e-9)


def test_turns_of_v_move_the_reference_and_turn_the_body(ames: Robot) -> None:
    """Compared with the second derivative of R_fv p."""
    ahead, p = FeedForward(ames, FeedForwardConfig(high_pass_hz=0.001)), np.array([2.5, 0.3, 0.0])
    amplitude, rate = 0.05, 2.0 * pi * 0.3
    found, wanted, torques = [], [], []
    for k in range(4000):
        t = k * H
        angle, speed = amplitude * sin(rate * t), amplitude * rate * cos(rate * t)
        R_fv = exp(np.array([0.0, 0.0, angle]))
        seen = VirtualView(R_fv, np.array([0.0, 0.0, speed]), p, R_fv.T, ZERO, ZERO)
        wrench = ahead.wrench(relative(UP), EYE, seen, p, H)
        found.append(wrench[:3])
        torques.append(wrench[5])
        spin = -amplitude * rate**2 * sin(rate * t)
        turned = R_fv @ p
        wanted.append(ames.mass * (np.cross([0, 0, spin], turned) - speed**2 * turned * [1, 1, 0]))
    error = np.array(found[2000:]) - np.array(wanted[2000:])
    size = np.sqrt((np.array(wanted[2000:]) ** 2).mean())
    assert np.sqrt((error**2).mean()) < 0.35 * size
    assert max(torques[2000:]) == pytest.approx(ames.inertia[2] * amplitude * rate**2, rel=0.1)


def test_a_growing_pull_is_balanced_and_one_that_was_there_is_not(ames: Robot) -> None:
    ahead, pull = FeedForward(ames, FeedForwardConfig()), np.array([2.0, -1.0, 0.5])
    for _ in range(400):  # at rest: thrust and spring share the weight as they always did
        ahead.observe(UP, EYE, np.array([0.3, 0.0, 0.2]), H)
    ahead.start()
    quiet = ahead.wrench(relative(UP), EYE, view(), ZERO, H)
    for _ in range(400):
        ahead.observe(UP + pull / ames.mass, EYE, np.array([0.3, 0.0, 0.2]), H)
    np.testing.assert_allclose(quiet, np.zeros(6), atol=1e-9)
    wrench = ahead.wrench(relative(UP), EYE, view(), ZERO, H)
    np.testing.assert_allclose(wrench[:3], -pull, atol=1e-3)


def test_its_own_thrust_is_no_pull(ames: Robot) -> None:
    ahead, thrust = FeedForward(ames, FeedForwardConfig()), np.array([1.0, 2.0, 3.0])
    for _ in range(400):
        ahead.observe(UP + thrust / ames.mass, EYE, thrust, H)
    np.testing.assert_allclose(
        ahead.wrench(relative(UP), EYE, view(), ZERO, H), np.zeros(6), atol=1e-2
    )


def test_a_robot_that_takes_off_does_not_carry_its_weight_twice() -> None:
    robot = load_robot("quadrotor").robot
    ahead, weight = FeedForward(robot, FeedForwardConfig()), np.array([0, 0, robot.weight_to_carry])
    for _ in range(400):
        ahead.observe(UP, EYE, ZERO, H)  # the floor carries it
    ahead.start()
    for _ in range(400):
        ahead.observe(UP, EYE, weight, H)  # thrusters do
    wrench = ahead.wrench(relative(UP), EYE, view(), ZERO, H)
    np.testing.assert_allclose(wrench, np.zeros(6), atol=0.02 * robot.weight_to_carry)


def fly(robot: Robot, stiffness: float, config: FeedForwardConfig | None) -> tuple[float, float]:
    """RMS error behind a hand that swings [m], and of the force's steps [N]."""
    rng = np.random.default_rng(0)
    pid, ahead = Pid(PHONE), FeedForward(robot, config or FeedForwardConfig())
    x = v = force = given = 0.0
    errors, asked = [], []
    for k in range(2600):
        t = k * H
        hand = 0.03 * sin(1.7 * t) + 0.015 * sin(2.9 * t + 1.0)
        speed = 0.051 * cos(1.7 * t) + 0.0435 * cos(2.9 * t + 1.0)
        a_hand = -0.0867 * sin(1.7 * t) - 0.12615 * sin(2.9 * t + 1.0)
        along = np.array([1.0, 0.0, 0.0])
        seen = view((x - hand) * along, (v - speed) * along)
        error = pose_error(seen, Reference(ZERO, EYE))
        wrench = pid.wrench(error, seen)
        felt = (force - stiffness * x - 1.5 * v) / robot.mass + 0.1 * rng.normal()
        if k == 10:
            ahead.start()
        ahead.observe(UP + felt * along, EYE, force * along, H)
        if config is not None:
            rounded = 0.1 * round(10.0 * (a_hand + 0.05))
            wrench = wrench + ahead.wrench(relative(UP + rounded * along), EYE, seen, ZERO, H)
        given = float(np.clip(wrench[0], -5.0, 5.0))
        pid.integrate(error, seen, wrench - np.clip(wrench, -5.0, 5.0), H)
        force += 0.2 * (given - force)
        v += H * (force - stiffness * x - 1.5 * v) / robot.mass
        x += H * v
        errors.append(x - hand)
        asked.append(given)
    return float(np.std(errors[1200:])), float(np.std(np.diff(asked[1200:])))


@pytest.mark.parametrize("stiffness", [0.0, 26.0])
def test_a_robot_follows_a_hand_more_closely_hanging_or_not(ames: Robot, stiffness: float) -> None:
    without, _ = fly(ames, stiffness, None)
    error, chatter = fly(ames, stiffness, FeedForwardConfig())
    assert error < 0.6 * without
    assert chatter < 0.1


def test_without_the_pull_a_hanging_robot_follows_worse(ames: Robot) -> None:
    without, _ = fly(ames, 26.0, None)
    error, _ = fly(ames, 26.0, FeedForwardConfig(pull_hz=0.0))
    assert error > without


def test_thrusters_that_give_more_than_they_are_told_are_to_be_told_less_for_the_same_weight() -> (
    None
):
    robot = load_robot("quadrotor").robot
    ahead, weight = FeedForward(robot, FeedForwardConfig()), np.array([0, 0, robot.weight_to_carry])
    ahead.start()
    for _ in range(1000):
        ahead.observe(UP, EYE, weight / 1.06, H)
    np.testing.assert_allclose(ahead.balanced_in_f, weight / 1.06 - weight, atol=0.02)
    ahead.start()
    np.testing.assert_array_equal(ahead.balanced_in_f, ZERO)
    for _ in range(40):
        ahead.observe(UP, EYE, 1.2 * weight, H)
    assert ahead.balanced_in_f[2] < 0.25 * 0.2 * weight[2], "a gust is none"


def test_what_hangs_has_nothing_to_balance_for_long(ames: Robot) -> None:
    ahead = FeedForward(ames, FeedForwardConfig())
    for _ in range(400):
        ahead.observe(UP, EYE, np.array([0.0, 0.0, 5.0]), H)
    np.testing.assert_array_equal(ahead.balanced_in_f, ZERO)
