"""Allocation: bounds exact, optimum exact, warm starts harmless."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from pipeline.allocation import Allocation
from pipeline.box_qp import box_least_squares
from pipeline.robot import Robot

LOW, HIGH = 0.2, 3.0


def random_problem(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    A, w = rng.normal(size=(6, n)), 6.0 * rng.normal(size=6)
    return A.T @ A + 1e-6 * np.eye(n), A.T @ w


@settings(max_examples=150)
@given(st.integers(0, 10**6), st.integers(6, 12))
def test_is_the_optimum_that_scipy_finds(seed: int, n: int) -> None:
    H, g = random_problem(seed, n)
    f = box_least_squares(H, g, LOW, HIGH, np.zeros(n, dtype=np.int8))
    L = np.linalg.cholesky(H)
    reference = lsq_linear(L.T, np.linalg.solve(L, g), (LOW, HIGH), method="bvls", tol=1e-14).x

    def cost(x: np.ndarray) -> float:
        return float(0.5 * x @ H @ x - g @ x)

    assert cost(f) <= cost(reference) + 1e-9 * (1.0 + abs(cost(reference)))
    assert f.min() >= LOW
    assert f.max() <= HIGH


def test_warm_start_from_any_other_problem_gives_the_same_thrusts() -> None:
    active = np.zeros(8, dtype=np.int8)
    for seed in range(200):
        H, g = random_problem(seed, 8)
        warm = box_least_squares(H, g, LOW, HIGH, active)
        cold = box_least_squares(H, g, LOW, HIGH, np.zeros(8, dtype=np.int8))
        np.testing.assert_allclose(warm, cold, atol=1e-9)


def cube_robot() -> Robot:
    rng = np.random.default_rng(1)
    positions, directions = rng.normal(size=(8, 3)), rng.normal(size=(8, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    A = np.vstack((directions.T, np.cross(0.3 * positions, directions).T))
    return Robot("random", np.zeros((5, 3)), A, LOW, HIGH, 2.3)


def test_a_feasible_wrench_is_achieved() -> None:
    robot = cube_robot()
    rng = np.random.default_rng(2)
    for _ in range(100):
        wrench = robot.A @ rng.uniform(LOW + 0.2, HIGH - 0.2, 8)
        thrusts = Allocation(robot).thrusts(wrench)
        np.testing.assert_allclose(robot.A @ thrusts, wrench, atol=1e-4)


def test_nothing_is_left_to_compile_when_the_first_wrench_comes() -> None:
    allocation = Allocation(cube_robot())
    compiled = len(box_least_squares.signatures)
    allocation.thrusts(np.ones(6))
    assert len(box_least_squares.signatures) == compiled > 0


def test_torque_is_kept_before_force_when_both_cannot_be_had() -> None:
    robot = cube_robot()
    wrench = robot.A @ np.full(8, 1.5) + np.array([40.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    achieved = robot.A @ Allocation(robot).thrusts(wrench)
    missing = np.abs(wrench - achieved)
    assert missing[3:].max() < 0.1 * missing[:3].max()
