"""The topics of a base of ROS 2, by Cyclone DDS, with the qualities of service of ROS's defaults.

A command is reliable and volatile, as ROS publishes by default, so that every subscription matches;
but only the newest is kept, and not for long, for one that comes again later is worse than none.
What the base says is read as ROS's sensors are: best effort, which matches who publishes reliably.

The robot file's `host` is where the base is looked for: 0.0.0.0 by multicast, as ROS does by
default, 127.* on this machine's loopback alone, any other address there, too, where no multicast
may come. Who else may be heard it does not say. What CYCLONEDDS_URI of the environment sets is kept
beside it.
"""

from __future__ import annotations

import ipaddress
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from hardware.follower import FollowerError
from hardware.link.address import ANYBODY, address_of
from hardware.link.base_end import HeardImu, HeardJoints, HeardOdometry
from hardware.link.ros2.messages import (
    UNREADABLE,
    RosHeader,
    RosImu,
    RosJointState,
    RosOdometry,
    RosPoint,
    RosPose,
    RosPoseStamped,
    RosQuaternion,
    RosTime,
    RosTwist,
    RosTwistStamped,
    RosVector3,
)
from hardware.pose_setpoint import BasePose
from hardware.robot_file import Ros2Parameters
from pipeline.frames import Array, R_from_wxyz, Triple, wxyz_from_R

MOST_MESSAGES = 128
"""Of a topic, taken at once; what came before is overwritten."""
NS_PER_S, NS_PER_US = 1_000_000_000, 1_000
TOLD = {"Twist": RosTwist, "TwistStamped": RosTwistStamped, "PoseStamped": RosPoseStamped}
"""By `link.ros2.message`."""
ROUGHLY_ONE = 1e-3
"""By so much the norm of a quaternion may be off."""
MISSING = -1.0  # what begins the covariance of something that is not measured
AS_ROS = Policy.DataRepresentation(use_cdrv0_representation=True)
LASTS_NS = 40_000_000
"""A command that was lost is not sent again later: if control then hangs, it would be obeyed anew.
As old as one that our own link's robot takes; readers count from its arrival, not by clocks."""
TELLS = Qos(
    Policy.Reliability.Reliable(0),
    Policy.Durability.Volatile,
    Policy.History.KeepLast(1),
    Policy.Lifespan(LASTS_NS),
    AS_ROS,
)
HEARS = Qos(
    Policy.Reliability.BestEffort,
    Policy.Durability.Volatile,
    Policy.History.KeepLast(MOST_MESSAGES),
    AS_ROS,
)
ALONE = (
    "<General><AllowMulticast>spdp</AllowMulticast>{interface}</General><Discovery>"
    "<SPDPInterval>1s</SPDPInterval><InitialLocatorPruneDelay>inf</InitialLocatorPruneDelay>"
    '<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="{host}"/></Peers></Discovery>'
)
"""Each second, for ever: the base may start after us."""
LOOPBACK = '<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'


@dataclass(frozen=True, eq=False)
class Opened:
    """What Cyclone DDS gives back once nobody holds it any more, in this order."""

    writer: DataWriter[Any]
    imu: DataReader[Any] | None
    odometry: DataReader[Any] | None
    joints: DataReader[Any] | None
    participant: DomainParticipant
    domain: Domain


class RosPorts:
    """A participant of a domain: one topic out, up to two in."""

    def __init__(
        self,
        topics: Ros2Parameters,
        host: str,
        wall_ns: Callable[[], int] = time.time_ns,
        tells: Qos = TELLS,
    ) -> None:
        """Listens, says nothing yet. `wall_ns` is the time in ROS's headers.

        Raises:
            FollowerError: no such address, or DDS can't be had on this machine's network.
        """
        self._message, self._frame, self._wall_ns = topics.message, topics.frame, wall_ns
        settings = _settings(address_of(host, "found by multicast"))
        try:
            self._opened: Opened | None = _open(topics, settings, tells)
        except (DDSException, UnicodeEncodeError) as error:
            what = f"DDS domain {topics.domain} (link.ros2.domain), robot at {host}: {error}"
            allowed = "a network that is up, CYCLONEDDS_URI unset or right, one link to a domain"
            raise FollowerError(what, allowed) from error

    def heard(self) -> Iterator[HeardImu | HeardOdometry | HeardJoints | None]:
        """What has arrived, odometry or joints first; None for each that can't be read."""
        assert self._opened is not None
        if self._opened.odometry is not None:
            wants_pose = self._message == "PoseStamped"
            for taken in _taken(self._opened.odometry):
                yield None if taken is None else _odometry(*taken, wants_pose=wants_pose)
        if self._opened.joints is not None:
            for taken in _taken(self._opened.joints):
                yield None if taken is None else _joints(*taken)
        if self._opened.imu is not None:
            for taken in _taken(self._opened.imu):
                yield None if taken is None else _imu(*taken)

    def tell(self, twist_in_b: Array) -> bool:
        """Publish a twist (6,) [m/s, rad/s]; False: nobody listens, or the way is down."""
        values = twist_in_b.tolist()
        twist = RosTwist(RosVector3(*values[:3]), RosVector3(*values[3:]))
        if self._message == "Twist":
            return self._write(twist)
        return self._write(RosTwistStamped(self._header(self._frame), twist))

    def tell_pose(self, pose: BasePose | None) -> bool:
        """Publish a pose, or nothing; gives the same."""
        if pose is None:
            return self._write(None)
        w, x, y, z = wxyz_from_R(pose.R_kb)
        place, attitude = RosPoint(*pose.p_bk_in_k.tolist()), RosQuaternion(x, y, z, w)
        return self._write(RosPoseStamped(self._header(pose.frame), RosPose(place, attitude)))

    def close(self) -> None:
        """Leave the domain; may be called twice."""
        self._opened = None

    def _write(self, message: RosTwist | RosTwistStamped | RosPoseStamped | None) -> bool:
        assert self._opened is not None
        writer = self._opened.writer
        try:
            if message is not None:
                writer.write(message)
        except DDSException:  # the way is down or full
            return False
        return bool(writer.get_publication_matched_status().current_count)

    def _header(self, frame: str) -> RosHeader:
        sec, nanosec = divmod(self._wall_ns(), NS_PER_S)
        return RosHeader(RosTime(sec, nanosec), frame)


def _settings(address: str) -> str:
    """Of Cyclone DDS, for a base at that address: what the environment says, and ours."""
    ours = ""
    if address != ANYBODY:
        interface = LOOPBACK if ipaddress.ip_address(address).is_loopback else ""
        alone = ALONE.format(interface=interface, host=address)
        ours = f"<CycloneDDS><Domain>{alone}</Domain></CycloneDDS>"
    return ",".join(filter(None, (os.environ.get("CYCLONEDDS_URI", ""), ours)))


def _open(topics: Ros2Parameters, settings: str, tells: Qos) -> Opened:
    domain = Domain(topics.domain, settings)
    participant = DomainParticipant(topics.domain)

    def topic(name: str, message: type[Any]) -> Topic[Any]:
        return Topic(participant, f"rt{name}", message)

    told = topic(topics.command, TOLD[topics.message])
    imu = odometry = joints = None
    if topics.imu:
        imu = DataReader(participant, topic(topics.imu, RosImu), qos=HEARS)
    if topics.odometry:
        odometry = DataReader(participant, topic(topics.odometry, RosOdometry), qos=HEARS)
    if topics.joint_states:
        joints = DataReader(participant, topic(topics.joint_states, RosJointState), qos=HEARS)
    writer = DataWriter(participant, told, qos=tells)
    return Opened(writer, imu, odometry, joints, participant, domain)


def _taken(reader: DataReader[Any]) -> Iterator[tuple[int, Any] | None]:
    """Writers and messages, one by one: one that can't be read takes no other with it."""
    for _ in range(MOST_MESSAGES):
        try:
            taken = reader.take(1)
        except UNREADABLE:
            yield None
            continue
        except DDSException:  # the way is down
            return
        if not taken:
            return
        info = taken[0].sample_info
        if info.valid_data:  # else: somebody has left
            yield info.publication_handle, taken[0]


def _imu(writer: int, message: RosImu) -> HeardImu:
    gyro, acc = message.angular_velocity_covariance, message.linear_acceleration_covariance
    return HeardImu(
        writer,
        _stamp_us(message.header),
        _vector(message.angular_velocity),
        _vector(message.linear_acceleration),
        measures_both=MISSING not in (gyro[0], acc[0]),
    )


def _odometry(writer: int, message: RosOdometry, *, wants_pose: bool) -> HeardOdometry:
    twist = message.twist.twist
    values = (*_vector(twist.linear), *_vector(twist.angular))
    pose = _pose(message.pose.pose, message.header.frame_id) if wants_pose else None
    return HeardOdometry(writer, values, _stamp_us(message.header), pose=pose)


def _pose(pose: RosPose, frame: str) -> BasePose | None:
    """None: its quaternion is none, as in messages whose pose nobody filled in."""
    place, turned = pose.position, pose.orientation
    wxyz = np.array([turned.w, turned.x, turned.y, turned.z])
    if not abs(float(np.linalg.norm(wxyz)) - 1.0) < ROUGHLY_ONE:
        return None
    return BasePose(R_from_wxyz(wxyz), np.array([place.x, place.y, place.z]), frame)


def _joints(writer: int, message: RosJointState) -> HeardJoints:
    return HeardJoints(
        writer,
        _stamp_us(message.header),
        tuple(message.name),
        tuple(message.position),
        tuple(message.velocity),
    )


def _stamp_us(header: RosHeader) -> int:
    return (header.stamp.sec * NS_PER_S + header.stamp.nanosec) // NS_PER_US


def _vector(vector: RosVector3) -> Triple:
    return vector.x, vector.y, vector.z
