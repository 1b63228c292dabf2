"""A simulated robot behind an RPIt client on a real socket, in virtual time, and what leads it."""

from __future__ import annotations

import numpy as np

from hardware.link.control_end import ControlEnd
from hardware.link.rpit.ground_end import GroundEnd, random_whole
from hardware.link.rpit.rpit_follower import NO_KEY, RpitFollower
from hardware.robot_file import RobotFile
from hardware.sim.plant.plant import Plant
from tests.hardware.link.flight import FollowerFlight
from tests.hardware.link.rpit.lab_robot import LabRobot, Model

LOCALHOST = "127.0.0.1"
BOOT_ID = 4_503_599_627_370_497
"""Needs more than 32 bits."""


class RpitRig:
    def __init__(self, robot_file: RobotFile, seed: int = 0, host: str = LOCALHOST) -> None:
        self.robot_file = robot_file
        self.body = self.plant = Plant(robot_file.plant, np.random.default_rng(seed))
        self.now = 50.0
        """On the ground station's clock, which is another than the robot's [s]."""
        self.follower = self.ground(1, host=host)
        self.robot = self.started(BOOT_ID, 1_000_000)

    def ground(self, epoch: int, port: int = 0, host: str = LOCALHOST) -> RpitFollower:
        """A control process's end; port 0 takes any free one."""
        end = ControlEnd.of(self.robot_file, NO_KEY, epoch, random_whole)
        return RpitFollower((LOCALHOST, port), GroundEnd(end, host), lambda: self.now)

    def started(self, boot_id: int, now_us: int) -> LabRobot:
        """The robot's computer after a start."""
        robot, rise = self.robot_file.robot, self.robot_file.link.max_rise
        model = Model(robot.A.shape[1], robot.f_max, rise, robot.ramp_s, boot_id)
        return LabRobot(self.plant, model, self.follower.port, now_us)

    def advance(self, dt: float) -> None:
        for _ in range(round(dt / 0.005)):
            self.now += 0.005
            self.robot.tick()

    def cut_link(self) -> None:
        self.robot.connected = False

    def close(self) -> None:
        self.follower.close()
        self.robot.close()


class RpitFlight(FollowerFlight, RpitRig):
    """The same as a follower, for a flight in virtual time."""


def bad_line(rng):
    """Loses, doubles and holds back until the next one 2 % of what it carries each."""
    held = []

    def carry(data):
        chance = rng.random()
        if chance < 0.02:
            return []
        if chance < 0.04 and not held:
            held.append(data)
            return []
        packets = [data, *held] + [data] * (chance > 0.98)
        held.clear()
        return packets

    return carry
