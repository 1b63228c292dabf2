"""Flights of robots without motion sensors, beside the same robots with them, in virtual time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hardware.robot_file import RobotFile, robot_of, robot_path, robot_table
from hardware.sim.plant.twist_plant import TwistPlant
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.config import TeleopConfig
from pipeline.frames import log
from pipeline.signals import Mode
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

LAG_UNTOLD_S = 0.06
"""By so much more than its file says a robot lags that measures nothing."""


def robot(name: str) -> RobotFile:
    """`rover` or `twister`; behind a dash: with sensors, its twist measured, or commanded."""
    base, how = name.split("-")
    table = robot_table(robot_path(base))
    for key in ("body_imu", "motion"):
        table.pop(key, None)
    level = base == "rover"
    table |= {
        "sensors": {"body_imu": robot_table(robot_path("twister"))["body_imu"]},
        "measured": {"motion": {"twist": "measured", "rate_hz": 20.0, "stands_level": level}},
        "commanded": {"motion": {"twist": "commanded", "stands_level": level}},
    }[how]
    return robot_of(table, name)


class Led:
    def __init__(self, name: str, seed: int) -> None:
        robot_file = robot(name)
        drive = robot_file.robot.twist
        assert drive is not None
        truth = robot_file
        if name.endswith("commanded"):
            slow = replace(drive, lag_s=drive.lag_s + LAG_UNTOLD_S)
            truth = replace(truth, robot=replace(truth.robot, twist=slow))
        scene = SimulationOptions(hand="filming", seed=seed, led_noise_px=0.1, gains="phone")
        follower = VirtualTimeFollower(truth, seed)
        self.loop = VirtualTimeSimulation(robot_file, TeleopConfig(), scene, follower=follower)
        self.nees: list[float] = []
        self.off: list[float] = []
        self.sigma: list[float] = []
        self.modes: list[Mode] = []

    def fly(self, seconds: float) -> Led:
        until = self.loop.t + seconds - 1e-9
        while self.loop.t < until:
            output = self.loop.advance()
            self.modes.append(output.failsafe.mode)
            if output.relative is None or not self.loop.trace.t:
                continue
            (R_fc, p_cf), (R_fb, p_bf) = self.loop.truth()
            beside = R_fc.T @ (p_bf - p_cf) - output.relative.p_bc_in_c
            e = np.append(beside, log(output.relative.R_cb.T @ R_fc.T @ R_fb))
            C = self.loop.controller.teleop.estimator.covariance
            self.nees.append(float(e @ np.linalg.solve(C, e)))
            self.off.append(float(np.linalg.norm(beside)))
            self.sigma.append(output.relative.sigma_p)
        return self

    def forget(self) -> Led:
        self.nees, self.off, self.sigma, self.modes = [], [], [], []
        return self

    @property
    def plant(self) -> TwistPlant:
        body = self.loop.follower.body
        assert isinstance(body, TwistPlant)
        return body
