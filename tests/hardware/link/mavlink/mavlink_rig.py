"""A simulated robot behind an autopilot of pymavlink on a real socket, in virtual time."""

from __future__ import annotations

import socket

import numpy as np

from hardware.contract import exchange
from hardware.link.mavlink.autopilot_end import AutopilotEnd
from hardware.link.mavlink.mavlink_follower import MavlinkFollower
from hardware.robot_file import robot_of, robot_path, robot_table
from hardware.sim.plant.twist_plant import TwistPlant
from tests.hardware.link.flight import FollowerFlight
from tests.hardware.link.mavlink.lab_autopilot import LOCALHOST, LabAutopilot

STAMP_BEFORE_S = 20.0
"""Of the autopilot's clock before ours."""
LEVEL = ["x", "y", "z", "yaw"]
MEASURED = {"twist": "measured", "rate_hz": 100.0, "stands_level": False}


def mavlink_robot(motion=None, host=LOCALHOST, **section):
    """The simulated robot that takes a twist, behind MAVLink; with `motion` without sensors."""
    table = robot_table(robot_path("twister")) | {"axes": LEVEL}
    if motion is not None:
        del table["body_imu"]
        table["motion"] = motion
    link = {"kind": "mavlink", "takes": "twist", "host": host, "mavlink": section}
    return robot_of(table | {"link": link}, "mavlink.toml")


def free_port():
    """One that nobody has just now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        asked.bind((LOCALHOST, 0))
        return asked.getsockname()[1]


class MavlinkRig:
    def __init__(self, robot_file=None, seed: int = 0, **autopilot) -> None:
        self.robot_file = robot_file or mavlink_robot()
        self.now = 50.0
        """On our clock, which is another than the autopilot's [s]."""
        self.booted = STAMP_BEFORE_S
        self.follower = self.leader(1)
        self.body, self.autopilot = self.flown(np.random.default_rng(seed), autopilot)

    def flown(self, rng, autopilot):
        """Body, and the autopilot that flies it."""
        drive, names = self.robot_file.robot.twist, self.robot_file.link.mavlink
        body = TwistPlant(drive, self.robot_file.plant.imu, rng)
        odometry = names.twist_from == "ODOMETRY"
        told = {"system": names.system, "odometry": odometry} | autopilot
        return body, LabAutopilot(self.follower.port, body, drive, **told)

    def leader(self, epoch: int, port: int = 0) -> MavlinkFollower:
        """A control process's end; port 0 takes any free one."""
        link = self.robot_file.link
        end = AutopilotEnd(self.robot_file, link.host, link.mavlink, epoch)
        thrusters = self.robot_file.robot.A.shape[1]
        return MavlinkFollower((LOCALHOST, port), end, lambda: self.now, thrusters=thrusters)

    @property
    def stamp(self) -> float:
        return self.now - self.booted

    def advance(self, dt: float) -> None:
        for _ in range(round(dt / 0.005)):
            self.now += 0.005
            self.autopilot.step(self.now, self.stamp)

    def cut_link(self) -> None:
        self.autopilot.connected = False

    def close(self) -> None:
        self.follower.close()
        self.autopilot.close()


def led(rig, seconds, command):
    """Samples of a rig that is told the same for so long."""
    samples = []
    for _ in range(round(seconds / 0.005)):
        samples += exchange(rig.follower, command)
        rig.advance(0.005)
    return samples


def told(rig):
    """(n, k): each set-point that its autopilot has read."""
    return np.array([set_point for _, set_point in rig.autopilot.taken])


class MavlinkFlight(FollowerFlight, MavlinkRig):
    """The same as a follower, for a flight in virtual time."""
