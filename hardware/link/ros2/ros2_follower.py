"""A robot that ROS 2 drives: `[link] kind = "ros2"`, registered as other packages register theirs.

Each command goes out as a twist, with control's own 200 Hz: zero, too, for most bases stop by
themselves when they hear nothing, but some never do. So the link says zero when it is given back,
and a base is armed only if its robot file says who stops it when not even that is heard. To a robot
that follows a pose it goes as one (`pose_setpoint.py`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from hardware.follower import BodySample, FollowerError, RobotCommand
from hardware.link.base_end import BaseEnd, HeardJoints
from hardware.link.link_follower import LinkFollower
from hardware.link.registry import LinkKind
from hardware.pose_setpoint import PoseSetpoint
from hardware.robot_file import RobotFile, Ros2Parameters

if TYPE_CHECKING:
    from hardware.link.ros2.joint_odometry import JointOdometry
    from hardware.link.ros2.ports import RosPorts

MISSING = "`pip install 'lightleash[ros2]'`, where Cyclone DDS has a wheel: docs/ros2.md"


class Ros2Follower(LinkFollower[BaseEnd]):
    """A robot on the topics of ROS 2."""

    thrusters = 0

    def __init__(
        self,
        ports: RosPorts,
        end: BaseEnd,
        clock: Callable[[], float] = time.monotonic,
        *,
        setpoint: PoseSetpoint | None = None,
        joints: JointOdometry | None = None,
    ) -> None:
        """Ready; says nothing yet. `setpoint` of one that takes poses, `joints` of an arm's."""
        super().__init__(end, clock)
        self._ports, self._setpoint, self._joints = ports, setpoint, joints
        self._is_heard = False
        """Somebody listened to the newest command."""

    def receive(self) -> list[BodySample]:
        """Return what has arrived. See `Follower`."""
        self._check_open()
        samples: list[BodySample] = []
        for heard in self._ports.heard():
            if heard is None:
                self._end.drop()
                continue
            if isinstance(heard, HeardJoints):
                assert self._joints is not None  # it is they who are listened to
                heard = self._joints.heard(heard)
            if heard is None:
                continue
            if (sample := self._end.hear(heard, self._clock())) is not None:
                samples.append(sample)
        if self._is_heard and (sample := self._end.beat(self._clock())) is not None:
            samples.append(sample)
        return samples

    def close(self) -> None:
        """Close. See `Follower`.

        Not without a word: a base carries itself, and nobody falls by zero.
        """
        self.stop()
        self._closed = True
        self._ports.close()

    def _send(self, command: RobotCommand) -> None:
        now = self._clock()
        twist_in_b = self._end.command(command, now)
        if self._setpoint is None:
            self._is_heard = self._ports.tell(twist_in_b)
        else:
            pose = self._setpoint.next(twist_in_b, self._end.pose, now, self._end.boot_id)
            self._is_heard = self._ports.tell_pose(pose)
        self.lost += not self._is_heard


def follower_of(
    robot_file: RobotFile,
    topics: Ros2Parameters,
    ports: RosPorts,
    epoch: int,
    clock: Callable[[], float] = time.monotonic,
) -> Ros2Follower:
    """Link to the robot of a robot file, by topics that are open.

    Raises:
        FollowerError: its arm's model can't be used.
    """
    drive = robot_file.robot.twist
    assert drive is not None  # no other robot's file has such a link
    end = BaseEnd(
        robot_file,
        epoch,
        topics.R_bi,
        has_odometry=bool(topics.odometry or topics.joint_states),
        says_where=topics.takes_pose,
    )
    setpoint = PoseSetpoint(drive) if topics.takes_pose else None
    joints = _joints_of(robot_file, topics)
    return Ros2Follower(ports, end, clock, setpoint=setpoint, joints=joints)


def _joints_of(robot_file: RobotFile, topics: Ros2Parameters) -> JointOdometry | None:
    arm = robot_file.plant.arm
    if not topics.joint_states or arm is None:
        return None
    # With MuJoCo, for which no other robot waits.
    from hardware.arm.arm_model import ArmError, ArmModel
    from hardware.link.ros2.joint_odometry import JointOdometry

    try:
        return JointOdometry(ArmModel(arm), topics.frame)
    except ArmError as error:
        raise FollowerError(f"arm.{error.key}", error.allowed) from error


def connect(robot_file: RobotFile, _key: bytes, epoch: int) -> Ros2Follower:
    """Link to the robot of a robot file. A `Connect` of `registry.py`.

    Raises:
        FollowerError: no Cyclone DDS, no such host, no network, another link in its domain, or an
            arm whose model can't be used.
    """
    try:
        from hardware.link.ros2.ports import RosPorts
    except ImportError as error:
        raise FollowerError(f"link.kind = 'ros2': {error}", MISSING) from error
    topics = robot_file.link.ros2
    if topics is None:
        raise FollowerError("link.kind = 'ros2'", "[link.ros2] in the robot file")
    ports = RosPorts(topics, robot_file.link.host)
    try:
        return follower_of(robot_file, topics, ports, epoch)
    except FollowerError:
        ports.close()
        raise


KIND = LinkKind(connect, stops_in_silence=False, keyed=False, takes=("twist",))
