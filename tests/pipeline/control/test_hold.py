"""Hold: takes over without a jump, lets force or momentum go, keeps weight and attitude."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import HoldConfig
from pipeline.control.hold import Hold
from pipeline.frames import Array, exp, log
from pipeline.robot import Robot

CONFIG = HoldConfig()
AMES, QUADROTOR, GROUND = (load_robot(name).robot for name in ("ames", "quadrotor", "ground"))
STILL = np.zeros(3)
H = 0.005


def momentum_taken(hold: Hold, seconds: float, weight: float = 0.0) -> Array:
    """Impulse in f (3,) [N s] beside the weight's, from a body that does not turn."""
    forces = [hold.R_fb @ hold.wrench(STILL, H)[:3] for _ in range(round(seconds / H))]
    impulse: Array = H * (np.array(forces) - (0.0, 0.0, weight)).sum(axis=0)
    return impulse


def test_takes_over_the_force_of_a_hanging_robot_and_lets_it_go() -> None:
    hold, force = Hold(CONFIG, AMES), np.array([1.0, -2.0, 3.0])
    hold.start(force, exp(np.array([0.1, 0.2, 0.3])), np.ones(3), np.ones(3))
    first = hold.wrench(STILL, 1e-6)
    np.testing.assert_allclose(first[:3], force, atol=1e-4)
    for _ in range(int(CONFIG.bleed_s / H)):
        last = hold.wrench(STILL, H)
    np.testing.assert_allclose(last[:3], force / np.e, rtol=1e-3)


def test_a_body_that_turns_is_turned_back_and_keeps_the_force_in_f() -> None:
    hold, R_fb = Hold(CONFIG, AMES), exp(np.array([0.0, 0.0, 0.5]))
    hold.start(np.array([2.0, 0.0, 0.0]), R_fb, STILL, STILL)
    omega = np.array([0.0, 0.0, 1.0])
    for _ in range(20):
        wrench = hold.wrench(omega, H)
    assert wrench[5] < -AMES.inertia[2] * (CONFIG.stiffness * 0.09 + CONFIG.damping * 0.99)
    in_f = hold.R_fb @ wrench[:3]
    np.testing.assert_allclose(hold.R_fb, R_fb @ exp(omega * 0.1), atol=1e-12)
    direction = in_f / np.linalg.norm(in_f)
    np.testing.assert_allclose(direction, R_fb @ np.array([1.0, 0.0, 0.0]), atol=1e-9)


def test_a_flying_robot_is_carried_whatever_its_attitude() -> None:
    hold, weight = Hold(CONFIG, QUADROTOR), np.array([0.0, 0.0, QUADROTOR.weight_to_carry])
    hold.start(np.array([1.0, 2.0, 15.0]), exp(np.array([0.2, -0.1, 2.0])), STILL, weight)
    for _ in range(600):
        wrench = hold.wrench(np.array([0.1, -0.1, 0.2]), H)
    np.testing.assert_allclose(hold.R_fb @ wrench[:3], weight, atol=1e-9)


def test_it_is_carried_even_if_tracking_never_was() -> None:
    wrench = Hold(CONFIG, QUADROTOR).wrench(STILL, H)
    np.testing.assert_allclose(wrench, (0.0, 0.0, QUADROTOR.weight_to_carry, 0.0, 0.0, 0.0))


def test_what_tracking_learnt_is_kept_within_bounds_and_never_lifts() -> None:
    hold, weight = Hold(CONFIG, QUADROTOR), QUADROTOR.weight_to_carry
    for learnt, kept in (
        ((0.1, -0.2, 0.97 * weight), (0.1, -0.2, 0.97 * weight)),
        ((9.0, -9.0, 2.0 * weight), (0.05 * weight, -0.05 * weight, weight)),
        ((0.0, 0.0, 0.1 * weight), (0.0, 0.0, 0.9 * weight)),
    ):
        hold.start(np.zeros(3), np.eye(3), STILL, np.array(learnt))
        np.testing.assert_allclose(hold.wrench(STILL, H)[:3], kept, atol=1e-12)


@pytest.mark.parametrize("robot", [QUADROTOR, GROUND], ids=lambda robot: str(robot.name))
def test_what_does_not_hang_loses_just_the_momentum_it_had(robot: Robot) -> None:
    hold, v = Hold(CONFIG, robot), np.array([0.3, -0.2, 0.1])
    weight = np.array([0.0, 0.0, robot.weight_to_carry])
    hold.start(np.array([5.0, 5.0, 5.0]), exp(np.array([0.0, 0.0, 0.7])), v, weight)
    taken = momentum_taken(hold, 10.0 * CONFIG.brake_s, robot.weight_to_carry)
    along = robot.axes[:3]
    np.testing.assert_allclose(taken[along], -robot.mass * v[along], rtol=0.01)


def test_axes_let_alone_get_nothing() -> None:
    hold = Hold(CONFIG, GROUND)
    hold.start(np.ones(3), exp(np.array([0.05, 0.05, 1.0])), np.ones(3), np.ones(3))
    for _ in range(50):
        wrench = hold.wrench(np.array([0.3, -0.4, 0.5]), H)
        np.testing.assert_array_equal(wrench[~GROUND.axes], 0.0)
        assert wrench[GROUND.axes].all()


def test_a_gyroscopes_bias_learnt_while_tracking_does_not_turn_it() -> None:
    hold, bias, rng = (
        Hold(CONFIG, QUADROTOR),
        np.array([0.01, -0.02, 0.015]),
        np.random.default_rng(1),
    )
    for _ in range(round(6.0 * CONFIG.learn_s / H)):
        hold.learn(bias + rng.normal(0.0, 0.01, 3), STILL, H)
    hold.start(np.zeros(3), np.eye(3), STILL, STILL)
    for _ in range(600):
        hold.wrench(bias, H)
    assert np.abs(log(hold.R_fb)).max() < 0.1 * 3.0 * 0.01


def test_an_accelerometers_bias_is_learnt_while_tracking_and_slowly() -> None:
    hold, bias = Hold(CONFIG, QUADROTOR), np.array([0.1, -0.2, 0.15])
    for _ in range(round(6.0 * CONFIG.learn_s / H)):
        hold.learn(STILL, bias, H)
    felt = hold.specific_force_in_b(bias)
    assert np.abs(felt).max() < 0.01
    for _ in range(round(0.1 / H)):  # an estimate that has begun to lie
        hold.learn(STILL, bias + 5.0, H)
    assert np.abs(hold.specific_force_in_b(bias) - felt).max() < 0.3
