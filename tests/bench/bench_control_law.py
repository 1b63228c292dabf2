"""What a tick of the control law costs, part by part, in CPU time of this thread.

python -m tests.bench.bench_control_law
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from hardware.dynamics import dynamics_of
from hardware.robot_file import load_robot
from pipeline.config import AllocationConfig, ComplianceConfig, FeedForwardConfig, TeleopConfig
from pipeline.control.allocation import LEAST_THRUST_WEIGHT, Allocation
from pipeline.control.compliance import Compliance
from pipeline.control.feedforward import FeedForward
from pipeline.control.latency_guard import LatencyGuard
from pipeline.control.pid import Pid, Reference, pose_error
from pipeline.signals import RelativeState, VirtualView

H = 0.005


def median_us(call: Callable[[int], object], runs: int) -> float:
    costs = []
    for k in range(runs):
        start = time.thread_time_ns()
        call(k)
        costs.append(time.thread_time_ns() - start)
    return float(np.median(costs)) / 1e3


def wrenches(runs: int) -> np.ndarray:
    """A wander that saturates now and then."""
    steps = np.random.default_rng(0).normal(size=(runs, 6)) * np.repeat((0.15, 0.04), 3)
    walk = np.zeros((runs, 6))
    for k in range(1, runs):
        walk[k] = 0.99 * walk[k - 1] + steps[k]
    return 2.2 * walk


def allocation() -> None:
    robot, asked = load_robot("ames").robot, wrenches(4000)
    weight = np.repeat((1.0, 10.0), 3)
    M = np.vstack((weight[:, None] * robot.A, np.sqrt(LEAST_THRUST_WEIGHT) * np.eye(8)))

    def scipy(k: int) -> object:
        target = np.concatenate((weight * asked[k], np.zeros(8)))
        return lsq_linear(M, target, (robot.f_min, robot.f_max), method="bvls")

    slow = median_us(scipy, 300)
    print(f"allocation, scipy lsq_linear (bvls)  {slow:8.1f} µs")
    for policy in ("torque_first", "scale", "lift", "clip"):
        solver = Allocation(robot, AllocationConfig(policy=policy))
        cost = median_us(lambda k, s=solver: s.thrusts(asked[k]), len(asked))
        missed = np.array([asked[k] - robot.A @ solver.thrusts(asked[k]) for k in range(1500)])
        short = np.abs(missed).max(axis=1) > 1e-3
        force, torque = np.abs(missed[short]).mean(axis=0).reshape(2, 3).max(axis=1)
        print(
            f"allocation, {policy:<24}{cost:8.1f} µs, {slow / cost:5.0f} x; when short "
            f"({100 * short.mean():.0f} %): {force:.2f} N, {torque:.3f} N m missing"
        )


def law() -> None:
    robot_file, config = load_robot("ames"), TeleopConfig()
    robot, zero = robot_file.robot, np.zeros(3)
    p, up = np.array([2.5, 0.0, 0.0]), np.array([0.0, 0.0, 9.8])
    view = VirtualView(np.eye(3), 0.1 + zero, p, np.eye(3), 0.1 + zero, 0.1 + zero)
    relative = RelativeState(0.0, p, np.eye(3), zero, zero, zero, np.eye(3), 0.0, 0.0, 0.0, up, up)
    pid, reference = Pid(config.gains), Reference(p + 0.01, np.eye(3))
    error = pose_error(view, reference)

    def control(_k: int) -> None:
        pid.wrench(pose_error(view, reference), view)
        pid.integrate(error, view, np.zeros(6), H)

    ahead = FeedForward(robot, FeedForwardConfig())

    def feed(_k: int) -> None:
        ahead.observe(up, np.eye(3), zero, H)
        ahead.wrench(relative, np.eye(3), view, p, H)

    soft = Compliance(ComplianceConfig(enabled=True))
    start = time.thread_time()
    guard = LatencyGuard(
        dynamics_of(robot, robot_file.plant), robot.axes, robot_file.gains, replace(config)
    )
    built = time.thread_time() - start
    print(f"pid (error, wrench, integral)  {median_us(control, 3000):6.1f} µs")
    print(f"feed-forward                   {median_us(feed, 3000):6.1f} µs")
    yielding = median_us(lambda _: soft.force(up, zero, up, H), 3000)
    print(f"compliance                     {yielding:6.1f} µs")
    refusal = median_us(lambda _: guard.refusal("phone", "relative", 0.09, 0.006), 3000)
    print(f"latency guard                  {refusal:6.1f} µs; built in {1e3 * built:.0f} ms")


if __name__ == "__main__":
    allocation()
    law()
