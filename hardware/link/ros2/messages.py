"""Messages of ROS 2 as DDS carries them: their fields in their order, named as rmw names types.

Made from the `.msg` files of geometry_msgs, sensor_msgs, nav_msgs, std_msgs and builtin_interfaces,
which have had these fields since the first ROS 2. Needs Cyclone DDS, which wants types, not their
names: so no `annotations` of the future.
"""

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, float64, int32, sequence, uint32

if TYPE_CHECKING:
    Nine = list[float]
    Square = list[float]
    Names = list[str]
    Numbers = list[float]
else:
    Nine = array[float64, 9]
    Square = array[float64, 36]
    Names = sequence[str]
    Numbers = sequence[float64]

UNREADABLE = (struct.error, ValueError, IndexError, OverflowError, MemoryError)
"""What Cyclone DDS raises for bytes that are no such message; it reads them in Python."""


@dataclass
@final
class RosVector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """geometry_msgs/Vector3."""

    x: float64
    y: float64
    z: float64


@dataclass
@final
class RosPoint(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    """geometry_msgs/Point."""

    x: float64
    y: float64
    z: float64


@dataclass
@final
class RosQuaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """geometry_msgs/Quaternion."""

    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
@final
class RosTwist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    """geometry_msgs/Twist [m/s, rad/s]."""

    linear: RosVector3
    angular: RosVector3


@dataclass
@final
class RosTime(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """builtin_interfaces/Time."""

    sec: int32
    nanosec: uint32


@dataclass
@final
class RosHeader(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """std_msgs/Header."""

    stamp: RosTime
    frame_id: str


@dataclass
@final
class RosTwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    """geometry_msgs/TwistStamped."""

    header: RosHeader
    twist: RosTwist


@dataclass
@final
class RosImu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    """sensor_msgs/Imu [rad/s, m/s²]; a covariance that begins with −1: not measured."""

    header: RosHeader
    orientation: RosQuaternion
    orientation_covariance: Nine
    angular_velocity: RosVector3
    angular_velocity_covariance: Nine
    linear_acceleration: RosVector3
    linear_acceleration_covariance: Nine


@dataclass
@final
class RosPose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    """geometry_msgs/Pose."""

    position: RosPoint
    orientation: RosQuaternion


@dataclass
@final
class RosPoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    """geometry_msgs/PoseStamped."""

    header: RosHeader
    pose: RosPose


@dataclass
@final
class RosJointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """sensor_msgs/JointState [rad, rad/s, N m]; each of the last three may be empty."""

    header: RosHeader
    name: Names
    position: Numbers
    velocity: Numbers
    effort: Numbers


@dataclass
@final
class RosPoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    """geometry_msgs/PoseWithCovariance."""

    pose: RosPose
    covariance: Square


@dataclass
@final
class RosTwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    """geometry_msgs/TwistWithCovariance."""

    twist: RosTwist
    covariance: Square


@dataclass
@final
class RosOdometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    """nav_msgs/Odometry; its twist is in the axes of `child_frame_id`."""

    header: RosHeader
    child_frame_id: str
    pose: RosPoseWithCovariance
    twist: RosTwistWithCovariance
