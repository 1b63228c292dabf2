"""Allocation: bounds exact, optimum exact, warm starts harmless, directions kept."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, lsq_linear

from hardware.robot_file import load_robot
from pipeline.config import AllocationConfig, SaturationPolicy
from pipeline.control.allocation import LEAST_THRUST_WEIGHT, Allocation
from pipeline.control.box_qp import box_least_squares
from pipeline.control.wrench_set import WrenchSet
from pipeline.robot import Robot

LOW, HIGH = 0.2, 3.0
WEIGHT = np.repeat((1.0, 10.0), 3)
POLICIES: tuple[SaturationPolicy, ...] = ("torque_first", "scale", "lift", "clip")
seeds = st.integers(0, 10**6)


def random_robot(seed: int, thrusters: int = 8, hangs: bool = True, axes: str = "111111") -> Robot:
    """Thrusters anywhere, pointing anywhere."""
    rng = np.random.default_rng(seed)
    positions, directions = rng.normal(size=(thrusters, 3)), rng.normal(size=(thrusters, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    A = np.vstack((directions.T, np.cross(0.3 * positions, directions).T))
    controlled = np.array([letter == "1" for letter in axes])
    return Robot("random", np.zeros((5, 3)), A, LOW, HIGH, 3.5, np.ones(3), controlled, hangs, 2.3)


def cancelling_robot(seed: int) -> Robot:
    """The eight thrusts of each of which cancel when they are equal, as the AMES'."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(8, 3))
    directions -= directions.mean(axis=0)
    moments = 0.3 * rng.normal(size=(8, 3))
    A = np.vstack((directions.T, (moments - moments.mean(axis=0)).T))
    return Robot(
        "cancels", np.zeros((5, 3)), A, LOW, HIGH, 3.5, np.ones(3), np.ones(6, bool), True, 2.3
    )


def quadrotor() -> Robot:
    arms = 0.16 * np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    up = np.tile([0.0, 0.0, 1.0], (4, 1))
    spin = 0.014 * np.array([1.0, -1.0, -1.0, 1.0])
    A = np.vstack((up.T, (np.cross(arms, up) + spin[:, None] * up).T))
    axes = np.array([True, True, True, False, False, True])
    return Robot("quad", np.zeros((5, 3)), A, 0.3, 7.0, 1.2, np.ones(3), axes, False, 6.0)


def random_wrench(seed: int, size: float = 6.0) -> np.ndarray:
    return size * np.random.default_rng(seed).normal(size=6) * np.repeat((1.0, 0.3), 3)


def allocation(robot: Robot, policy: SaturationPolicy = "torque_first") -> Allocation:
    return Allocation(robot, AllocationConfig(policy=policy))


@settings(max_examples=25)
@given(seeds, st.integers(6, 12))
def test_torque_first_gives_the_thrusts_that_scipy_finds(seed: int, thrusters: int) -> None:
    robot, wrench = random_robot(seed, thrusters), random_wrench(seed)
    weighted = WEIGHT[:, None] * robot.A
    M = np.vstack((weighted, np.sqrt(LEAST_THRUST_WEIGHT) * np.eye(thrusters)))
    target = np.concatenate((WEIGHT * wrench, np.zeros(thrusters)))
    reference = lsq_linear(M, target, (LOW, HIGH), method="bvls", tol=1e-15, max_iter=500).x
    thrusts = allocation(robot).thrusts(wrench)
    np.testing.assert_allclose(thrusts, reference, atol=1e-6)
    assert thrusts.min() >= LOW
    assert thrusts.max() <= HIGH


@settings(max_examples=40)
@given(seeds, st.integers(6, 16))
def test_the_optimum_satisfies_its_conditions(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    A, w = rng.normal(size=(6, n)), 6.0 * rng.normal(size=6)
    H, g = A.T @ A + 1e-6 * np.eye(n), A.T @ w
    f = box_least_squares(H, g, LOW, HIGH, np.zeros(n, dtype=np.int8))
    slope = H @ f - g
    assert slope[f <= LOW].min(initial=0.0) > -1e-9
    assert slope[f >= HIGH].max(initial=0.0) < 1e-9
    assert np.abs(slope[(f > LOW) & (f < HIGH)]).max(initial=0.0) < 1e-9


@pytest.mark.parametrize("policy", POLICIES)
def test_what_was_asked_before_does_not_matter(policy: SaturationPolicy) -> None:
    robot = cancelling_robot(3)
    warm = allocation(robot, policy)
    for seed in range(150):
        wrench = random_wrench(seed)
        cold = allocation(robot, policy).thrusts(wrench) if seed % 10 == 0 else None
        thrusts = warm.thrusts(wrench)
        if cold is not None:
            np.testing.assert_allclose(thrusts, cold, atol=1e-7)


@pytest.mark.parametrize("policy", ["torque_first", "scale"])
def test_a_wrench_that_can_be_had_is_given_with_the_least_thrusts(policy: SaturationPolicy) -> None:
    robot, rng = random_robot(1), np.random.default_rng(2)
    solver = allocation(robot, policy)
    _, _, rows = np.linalg.svd(robot.A)
    null = rows[6:]
    for _ in range(100):
        wrench = robot.A @ rng.uniform(LOW + 0.2, HIGH - 0.2, 8)
        thrusts = solver.thrusts(wrench)
        np.testing.assert_allclose(robot.A @ thrusts, wrench, atol=1e-4)
        for step in 1e-3 * np.vstack((null, -null)):
            other = thrusts + step
            if (other >= LOW).all() and (other <= HIGH).all():
                assert other @ other > thrusts @ thrusts - 1e-6


def share_error(robot: Robot, solver: Allocation, wrench: np.ndarray) -> float:
    """Of the wrench that `scale` gives, against a linear programme's; NaN if no share exists."""
    programme = linprog(
        np.append(np.zeros(8), -1.0),
        A_eq=np.column_stack((robot.A, -wrench)),
        b_eq=np.zeros(6),
        bounds=[(robot.f_min, robot.f_max)] * 8 + [(0.0, 1.0)],
    )
    if programme.status != 0:
        return np.nan
    achieved = robot.A @ solver.thrusts(wrench)
    return float(np.abs(achieved - programme.x[-1] * wrench).max())


def test_scale_gives_the_largest_share_and_keeps_the_direction() -> None:
    robot = load_robot("ames").robot
    solver = allocation(robot, "scale")
    errors = [share_error(robot, solver, random_wrench(seed)) for seed in range(50)]
    assert np.max(errors) < 1e-7


def test_scale_is_as_exact_on_other_robots_unless_thrusters_are_nearly_parallel() -> None:
    errors = []
    for seed in range(50):
        robot = cancelling_robot(seed) if seed % 2 else random_robot(seed)
        errors.append(share_error(robot, allocation(robot, "scale"), random_wrench(seed)))
    assert np.nanquantile(errors, 0.95) < 1e-6
    assert np.nanmax(errors) < 1e-3
    assert np.isfinite(errors).sum() > 25


def test_lift_differs_from_torque_first_only_where_it_cuts_and_cuts_torque_too() -> None:
    robot = load_robot("ames").robot
    missing, kept = [], []
    lift, torque_first = allocation(robot, "lift"), allocation(robot)
    for seed in range(100):
        wrench = random_wrench(seed, 3.0) * np.repeat((1.0, 0.1), 3)
        thrusts = lift.thrusts(wrench)
        if thrusts.max() < robot.f_max:
            np.testing.assert_allclose(thrusts, torque_first.thrusts(wrench), atol=1e-9)
        else:
            missing.append(wrench - robot.A @ thrusts)
            kept.append(wrench - robot.A @ torque_first.thrusts(wrench))
    assert 10 < len(missing) < 90
    assert np.std(missing, axis=0)[3:].max() > 2.0 * np.std(kept, axis=0)[3:].max()


def test_where_no_share_can_be_had_scale_does_what_torque_first_does() -> None:
    robot = quadrotor()
    falling = np.array([0.0, 0.0, -5.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        allocation(robot, "scale").thrusts(falling), allocation(robot).thrusts(falling)
    )


def test_scale_refuses_a_robot_that_cannot_drive_its_axes() -> None:
    with pytest.raises(ValueError, match="rank below its 6 axes"):
        allocation(random_robot(0, thrusters=5), "scale")


def test_torque_first_keeps_the_torque_when_both_cannot_be_had_and_clip_does_not() -> None:
    missing = {}
    for policy in POLICIES:
        robot, errors = cancelling_robot(5), []
        solver = allocation(robot, policy)
        for seed in range(50):
            wrench = random_wrench(seed, 8.0) * np.repeat((1.0, 0.1), 3)
            errors.append(np.abs(wrench - robot.A @ solver.thrusts(wrench)))
        missing[policy] = np.mean(errors, axis=0)
    assert missing["torque_first"][3:].max() < 0.05 * missing["torque_first"][:3].max()
    assert missing["torque_first"][3:].max() < 0.5 * missing["clip"][3:].max()


@pytest.mark.parametrize("policy", POLICIES)
@settings(max_examples=15)
@given(seed=seeds)
def test_no_policy_leaves_the_limits(policy: SaturationPolicy, seed: int) -> None:
    thrusts = allocation(cancelling_robot(seed), policy).thrusts(random_wrench(seed, 50.0))
    assert thrusts.min() >= LOW
    assert thrusts.max() <= HIGH


@pytest.mark.parametrize("policy", POLICIES)
def test_axes_that_are_let_alone_weigh_nothing(policy: SaturationPolicy) -> None:
    robot = random_robot(4, axes="110001")
    wrench = np.array([0.5, -0.4, 0.0, 0.0, 0.0, 0.05])
    nonsense = np.array([0.0, 0.0, 30.0, -20.0, 10.0, 0.0])
    plain = allocation(robot, policy).thrusts(wrench)
    np.testing.assert_allclose(allocation(robot, policy).thrusts(wrench + nonsense), plain)
    if policy != "clip":
        np.testing.assert_allclose((robot.A @ plain)[robot.axes], wrench[robot.axes], atol=1e-4)


def test_a_quadrotor_hovers_and_turns() -> None:
    wrench = np.array([0.0, 0.0, 11.8, 0.2, -0.1, 0.02])
    for policy in POLICIES:
        achieved = quadrotor().A @ allocation(quadrotor(), policy).thrusts(wrench)
        np.testing.assert_allclose(achieved, wrench, atol=1e-4)


def test_the_faces_bound_exactly_what_thrusts_give() -> None:
    robot, rng = random_robot(7), np.random.default_rng(8)
    faces = WrenchSet(robot.A, LOW, HIGH)
    for _ in range(300):
        least, largest = faces.shares(robot.A @ rng.uniform(LOW, HIGH, 8))
        assert least <= 1.0 <= largest
        outwards = rng.normal(size=6)
        farthest = np.where(robot.A.T @ outwards > 0.0, HIGH, LOW)
        least, largest = faces.shares(robot.A @ farthest + 1e-6 * outwards)
        assert not least <= 1.0 <= largest


def test_nothing_is_left_to_compile_when_the_first_wrench_comes() -> None:
    solver = allocation(random_robot(1), "scale")
    compiled = len(box_least_squares.signatures)
    solver.thrusts(np.ones(6))
    assert len(box_least_squares.signatures) == compiled > 0
