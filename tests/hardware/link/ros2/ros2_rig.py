"""A simulated base behind real DDS, both in this process and in virtual time, and who leads it."""

from __future__ import annotations

import itertools
import os
import time

from cyclonedds.qos import Policy, Qos

from hardware.link.ros2.ports import TELLS, RosPorts
from hardware.link.ros2.ros2_follower import Ros2Follower, follower_of
from hardware.robot_file import COMMANDS, load_robot, robot_of, robot_path, robot_table
from tests.hardware.link.flight import FollowerFlight
from tests.hardware.link.ros2.lab_base import LabBase, PoseBody, PoseStamped, twister

LOCALHOST = "127.0.0.1"
STAMP_AHEAD_S = 1_700_000_000.0
"""Of the base's clock before ours."""
TIMELESS = Qos(Policy.Lifespan(2**63 - 1), base=TELLS)
"""DDS counts a command's life on the wall, where a pause of the machine between a command and the
base's turn to listen is no time at all."""
TWISTER = load_robot("twister", takes=COMMANDS)
BELOW = f"/test_{os.getpid()}"
"""Tests of other processes may be in the same domain, but not under the same names."""
PATIENCE_S = 20.0
_domains = itertools.cycle(range(20, 100))
"""Those that Linux keeps ports for."""


def new_domain() -> int:
    """One that this process has long left."""
    return next(_domains)


def patiently():
    """Again and again, while the other side may yet do it."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        time.sleep(0.005)
        yield
    raise AssertionError(f"not within {PATIENCE_S} s")


def ros2_robot(**changes):
    """The simulated robot that takes a twist, behind ROS 2, in a domain of its own."""
    table = robot_table(robot_path("twister"))
    return behind_ros2(table, {"imu": "imu", "odometry": "odom"} | changes)


def pose_robot(**changes):
    """The same without motion sensors, which takes poses and says where it is."""
    table = robot_table(robot_path("twister"))
    del table["body_imu"]
    table["motion"] = {"twist": "measured", "rate_hz": 200.0, "stands_level": False}
    return behind_ros2(table, {"odometry": "odom", "message": "PoseStamped"} | changes)


def arm_robot(**changes):
    """The arm that ships, without its gripper: its joints say where it is, it is told poses."""
    table = robot_table(robot_path("so101"))
    del table["tool"], table["arm"]["tool_joint"], table["arm"]["tool_stroke_s"]
    return behind_ros2(table, {"joint_states": "joint_states", "message": "PoseStamped"} | changes)


def behind_ros2(table, section):
    """The robot of a table by that section, but for keys without a value."""
    section = {"domain": new_domain(), "namespace": BELOW} | section
    section = {key: value for key, value in section.items() if value is not None}
    link = {"kind": "ros2", "takes": "twist", "host": LOCALHOST, "ros2": section}
    return robot_of(table | {"link": link}, str(robot_path(table["name"])))


class Ros2Rig:
    def __init__(self, robot_file=None, seed: int = 0, tells: Qos = TIMELESS, **base) -> None:
        self.robot_file = robot_file or ros2_robot()
        self.now, self.started_s = 50.0, 0.0
        """On our clock, which is another than the base's [s]; how far that was set back."""
        self.topics = self.robot_file.link.ros2
        self._tells = tells
        self.follower = self.leader(1)
        self.body, drive = twister(seed)
        if base.get("kind") is PoseStamped:
            self.body = PoseBody()
        self.base = LabBase(self.topics.domain, self.body, drive, **{"below": BELOW} | base)

    def leader(self, epoch: int) -> Ros2Follower:
        """A control process's end; its domain is new, and ends with it."""
        ports = RosPorts(self.topics, LOCALHOST, lambda: round(1e9 * self.stamp), self._tells)
        return follower_of(self.robot_file, self.topics, ports, epoch, lambda: self.now)

    @property
    def stamp(self) -> float:
        return self.now + STAMP_AHEAD_S - self.started_s

    def advance(self, dt: float) -> None:
        for _ in range(round(dt / 0.005)):
            self.now += 0.005
            self.base.step(self.now, self.stamp)

    def cut_link(self) -> None:
        self.base.connected = False

    def close(self) -> None:
        self.follower.close()


class Ros2Flight(FollowerFlight, Ros2Rig):
    """The same as a follower, for a flight in virtual time."""
