"""A base of ROS 2 as somebody else would write it: from its `.msg` files and docs/ros2.md alone.

Its own time-out, as base controllers have, brakes it within its accelerations. As a process of its
own: `python -m tests.hardware.link.ros2.lab_base --domain 7 --seconds 5`, in real time; prints what
it was told as JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import time
from dataclasses import dataclass

import numpy as np
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from scipy.spatial.transform import Rotation

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.plant.twist_plant import TwistPlant

PERIOD_S = 0.005
TIMEOUT_S = 0.06
FOLLOWS_S = 0.05
"""Time constant by which it goes to a pose."""
RELIABLE = Policy.Reliability.Reliable(100_000_000)
DEFAULT = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(10))
PATIENT = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(1000))
"""ROS keeps 10; here a pause of the machine is to overwrite none."""
SENSORS = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(5))


def named(name, /):
    """package/Name as rmw calls it."""
    package, _, message = name.partition("/")
    return f"{package}::msg::dds_::{message}_"


def message(name, /, **fields):
    """A message of these fields, each a type, as `rosidl` would make it."""
    made = type(
        name.replace("/", "_"), (IdlStruct,), {"__annotations__": fields}, typename=named(name)
    )
    return final(dataclass(made))


Time = message("builtin_interfaces/Time", sec=int32, nanosec=uint32)
Header = message("std_msgs/Header", stamp=Time, frame_id=str)
Vector3 = message("geometry_msgs/Vector3", x=float64, y=float64, z=float64)
Point = message("geometry_msgs/Point", x=float64, y=float64, z=float64)
Quaternion = message("geometry_msgs/Quaternion", x=float64, y=float64, z=float64, w=float64)
Twist = message("geometry_msgs/Twist", linear=Vector3, angular=Vector3)
TwistStamped = message("geometry_msgs/TwistStamped", header=Header, twist=Twist)
Pose = message("geometry_msgs/Pose", position=Point, orientation=Quaternion)
PoseStamped = message("geometry_msgs/PoseStamped", header=Header, pose=Pose)
JointState = message(
    "sensor_msgs/JointState",
    header=Header,
    name=sequence[str],
    position=sequence[float64],
    velocity=sequence[float64],
    effort=sequence[float64],
)
PoseWithCovariance = message(
    "geometry_msgs/PoseWithCovariance", pose=Pose, covariance=array[float64, 36]
)
TwistWithCovariance = message(
    "geometry_msgs/TwistWithCovariance", twist=Twist, covariance=array[float64, 36]
)
Imu = message(
    "sensor_msgs/Imu",
    header=Header,
    orientation=Quaternion,
    orientation_covariance=array[float64, 9],
    angular_velocity=Vector3,
    angular_velocity_covariance=array[float64, 9],
    linear_acceleration=Vector3,
    linear_acceleration_covariance=array[float64, 9],
)
Odometry = message(
    "nav_msgs/Odometry",
    header=Header,
    child_frame_id=str,
    pose=PoseWithCovariance,
    twist=TwistWithCovariance,
)
LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General>"
    '<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>'
    "</Discovery></Domain></CycloneDDS>"
)
MULTICAST = (
    "<CycloneDDS><Domain><General><AllowMulticast>spdp</AllowMulticast><Interfaces>"
    '<NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces></General>'
    "<Discovery><ParticipantIndex>none</ParticipantIndex></Discovery></Domain></CycloneDDS>"
)
"""As rmw_cyclonedds does by default: nobody finds it who asks at its address alone."""
NOTHING = Quaternion(0.0, 0.0, 0.0, 1.0)


def header(stamp, frame):
    sec, nanosec = divmod(round(1e9 * stamp), 10**9)
    return Header(Time(sec, nanosec), frame)


def imu_message(stamp, omega, a, gyro_missing=False):
    gyro = [-1.0 if gyro_missing else 0.0, *8 * [0.0]]
    none = [-1.0, *8 * [0.0]]  # it has no attitude to tell
    return Imu(header(stamp, "imu"), NOTHING, none, Vector3(*omega), gyro, Vector3(*a), 9 * [0.0])


def pose_of(R, p):
    return Pose(Point(*p.tolist()), Quaternion(*Rotation.from_matrix(R).as_quat().tolist()))


NOWHERE = Pose(Point(0.0, 0.0, 0.0), NOTHING)


def odometry_message(stamp, twist, where=NOWHERE):
    pose = PoseWithCovariance(where, 36 * [0.0])
    moves = TwistWithCovariance(Twist(Vector3(*twist[:3]), Vector3(*twist[3:])), 36 * [0.0])
    return Odometry(header(stamp, "odom"), "base_link", pose, moves)


class PoseBody:
    """Goes where it is told by a first-order lag, as arms do; it feels nothing."""

    def __init__(self, R_fb=None, p_in_f=(0.3, -0.2, 0.5)):
        self.R_fb = np.eye(3) if R_fb is None else R_fb
        self.p_in_f, self.twist_in_b = np.array(p_in_f), np.zeros(6)

    def step(self, goal, dt):
        self.twist_in_b = np.zeros(6)
        if goal is None:
            return
        place, turned = goal.position, goal.orientation
        R_goal = Rotation.from_quat([turned.x, turned.y, turned.z, turned.w]).as_matrix()
        to_go = np.array([place.x, place.y, place.z]) - self.p_in_f
        to_turn = Rotation.from_matrix(self.R_fb.T @ R_goal).as_rotvec()
        share = 1.0 - np.exp(-dt / FOLLOWS_S)
        self.twist_in_b = np.concatenate((self.R_fb.T @ to_go, to_turn)) * share / dt
        self.p_in_f = self.p_in_f + share * to_go
        self.R_fb = self.R_fb @ Rotation.from_rotvec(share * to_turn).as_matrix()


class LabBase:
    """Moves, feels and speaks when it is told that time has passed."""

    def __init__(self, domain, body, drive, below="", kind=Twist, odometry=True):
        self.participant = DomainParticipant(domain)
        told = Topic(self.participant, f"rt{below}/cmd_vel", kind)
        self.commands = DataReader(self.participant, told, qos=PATIENT)
        imu = Topic(self.participant, f"rt{below}/imu", Imu)
        self.imu = DataWriter(self.participant, imu, qos=SENSORS)
        odom = Topic(self.participant, f"rt{below}/odom", Odometry)
        self.odometry = DataWriter(self.participant, odom, qos=DEFAULT) if odometry else None
        self.body, self.drive, self.kind = body, drive, kind
        self.told, self.goal, self.heard_at = np.zeros(6), None, -1.0
        self.connected = True
        self.taken = []
        """Each command: when it was taken, its stamp, its twist (6,) or pose."""

    def listen(self, now):
        for one in self.commands.take(100):
            if not one.sample_info.valid_data or not self.connected:
                continue
            stamp = None
            if self.kind is not Twist:
                stamp = one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec
            if self.kind is PoseStamped:
                assert one.header.frame_id == "odom"
                self.goal = one.pose
                self.taken.append((now, stamp, one.pose))
                continue
            twist = one.twist if stamp is not None else one
            v, omega = twist.linear, twist.angular
            self.told, self.heard_at = np.array([v.x, v.y, v.z, omega.x, omega.y, omega.z]), now
            self.taken.append((now, stamp, self.told))

    def step(self, now, stamp):
        """One period, which ends at `now`; `stamp` is what its clock shows then."""
        self.listen(now)
        if now - self.heard_at > TIMEOUT_S:
            self.told = self.drive.toward(self.told, np.zeros(6), PERIOD_S)
        self.body.step(self.goal if self.kind is PoseStamped else self.told, PERIOD_S)
        if self.connected:
            self.speak(stamp)

    def speak(self, stamp):
        if self.odometry is not None:
            twist = self.body.twist_in_b.tolist()
            if self.kind is PoseStamped:  # of which odometry alone says how it moves
                where = pose_of(self.body.R_fb, self.body.p_in_f)
                self.odometry.write(odometry_message(stamp, twist, where))
                return
            self.odometry.write(odometry_message(stamp, twist))
        omega, a = self.body.imu()
        self.imu.write(imu_message(stamp, omega.tolist(), a.tolist()))


def twister(seed=0):
    """Body and drive of the simulated one."""
    robot = load_robot("twister", takes=COMMANDS)
    rng = np.random.default_rng(seed)
    return TwistPlant(robot.robot.twist, robot.plant.imu, rng), robot.robot.twist


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--domain", type=int, required=True)
    parser.add_argument("--below", default="", help="namespace of its topics")
    parser.add_argument("--multicast", action="store_true", help="found by nothing else")
    arguments = parser.parse_args()
    ours = MULTICAST if arguments.multicast else LOOPBACK
    settings = ",".join((os.environ.get("CYCLONEDDS_URI", ""), ours))
    domain = Domain(arguments.domain, settings)
    base = LabBase(arguments.domain, *twister(), below=arguments.below)
    ended, start, moves = [], time.monotonic(), []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
    while not ended:
        due = start + PERIOD_S * (len(moves) + 1)
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        base.step(now, time.time())
        moves.append((now, float(base.body.twist_in_b[0])))
    taken = [(now, twist.tolist()) for now, _, twist in base.taken]
    print(json.dumps({"taken": taken, "moves": moves}))
    del base, domain


if __name__ == "__main__":
    main()
