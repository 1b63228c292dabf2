"""Schema of files of robots that take a twist: what the others' says of thrusters is missing."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians
from typing import Annotated, Literal

from pydantic import Field

from hardware.robot_schema import (
    AXES,
    USUAL_PORTS,
    Axis,
    BatterySection,
    BodyImuSection,
    Direction,
    LedSection,
    Section,
    Start,
    axes_fault,
    battery_clashes,
)
from pipeline.control.twist_margins import LEAST_PHASE_RAD
from pipeline.robot import TwistDrive

TOLD_ZERO_S = 0.17
"""After its last command a robot in silence has been told to stand still."""
LONGEST_STOP_S = 0.11
"""The braking itself; by our own link it begins 60 ms after the last command."""


class TwistSection(Section):
    """[twist]: how the robot follows a velocity and an angular rate."""

    speed_m_s: Annotated[float, Field(gt=0.0, le=2.0)]
    acceleration_m_s2: Annotated[float, Field(gt=0.0, le=50.0)]
    """Braking included."""
    rate_deg_s: Annotated[float, Field(gt=0.0, le=360.0)]
    angular_acceleration_deg_s2: Annotated[float, Field(gt=0.0, le=10_000.0)]
    lag_s: Annotated[float, Field(gt=0.0, le=0.5)]
    """Time constant of its own controller."""
    delay_s: Annotated[float, Field(ge=0.0, le=0.5)]
    position_gain_per_s: Annotated[float, Field(gt=0.0, le=20.0)]
    """Speed per distance to where it should be."""
    attitude_gain_per_s: Annotated[float, Field(gt=0.0, le=20.0)]


ROS_NAME = r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"
RosName = Annotated[str, Field(pattern=f"^{ROS_NAME}$", max_length=200)]
"""Of a topic: below the namespace, unless it begins with a stroke."""


NO_IMU = (
    "topic of the base's sensor_msgs/Imu: the estimate needs a gyroscope and an accelerometer on"
    " the body, and none here does without"
)


class Ros2Section(Section):
    """[link.ros2]: where a base of ROS 2 listens and speaks; see `link/ros2/`."""

    domain: Annotated[int, Field(ge=0, le=232)] = 0
    """ROS_DOMAIN_ID of the base."""
    namespace: Annotated[str, Field(pattern=f"^(/|{ROS_NAME})$", max_length=200)] = "/"
    command: RosName = "cmd_vel"
    """geometry_msgs/Twist, or TwistStamped if ..."""
    stamped: bool = False
    frame: Annotated[str, Field(pattern=r"^[!-~]{1,100}$")] = "base_link"
    """... in the header of a TwistStamped."""
    imu: RosName | None = None
    """sensor_msgs/Imu, of the body; nobody is led without, see `NO_IMU`."""
    imu_axes: Annotated[
        list[Direction], Field(min_length=3, max_length=3, default_factory=lambda: ["x", "y", "z"])
    ]
    """Along which axis of its motion sensors each of the body's lies."""
    odometry: RosName | None = None
    """nav_msgs/Odometry; without it the robot is taken to move as told, after its delay and lag."""


class TwistLinkSection(Section):
    """[link] of a robot that takes a twist."""

    kind: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,32}$")] = "udp"
    takes: Literal["twist"]
    stopped_by: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    host: Annotated[str, Field(min_length=1, max_length=253)]
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    ros2: Ros2Section | None = None


class TwistRobotSchema(Section):
    """The file."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,32}$")]
    axes: Annotated[
        list[Axis], Field(min_length=1, max_length=6, default_factory=lambda: list(AXES))
    ]
    """Controlled, in the body's axes; along and about the others it is told zero."""
    blinks: bool = False
    start: Start = Start()
    twist: TwistSection
    body_imu: BodyImuSection
    leds: Annotated[list[LedSection], Field(min_length=4, max_length=16)]
    link: TwistLinkSection
    battery: BatterySection | None = None


def drive_of(section: TwistSection) -> TwistDrive:
    """The section in SI."""
    return TwistDrive(
        speed=section.speed_m_s,
        acceleration=section.acceleration_m_s2,
        rate=radians(section.rate_deg_s),
        angular_acceleration=radians(section.angular_acceleration_deg_s2),
        position_gain=section.position_gain_per_s,
        attitude_gain=section.attitude_gain_per_s,
        lag_s=section.lag_s,
        delay_s=section.delay_s,
    )


def twist_clashes(robot: TwistRobotSchema) -> Iterator[tuple[str, str]]:
    """Keys that contradict each other: (key, what would be allowed)."""
    if robot.link.port is None and robot.link.kind not in USUAL_PORTS:
        yield "link.port", f"missing: a link of kind {robot.link.kind!r} has no usual one"
    yield from battery_clashes(robot.battery)
    yield from _ros2_clashes(robot.link)
    if len(set(robot.axes)) < len(robot.axes):
        yield "axes", "each word once"
    drive = drive_of(robot.twist)
    if drive.speed > LONGEST_STOP_S * drive.acceleration:
        least = drive.speed / LONGEST_STOP_S
        yield "twist.acceleration_m_s2", f"{least:.2f} or more: it must stop in {LONGEST_STOP_S} s"
    if drive.rate > LONGEST_STOP_S * drive.angular_acceleration:
        least = robot.twist.rate_deg_s / LONGEST_STOP_S
        key = "twist.angular_acceleration_deg_s2"
        yield key, f"{least:.0f} or more: it must stop in {LONGEST_STOP_S} s"
    for key in ("position_gain_per_s", "attitude_gain_per_s"):
        if drive.phase_margin(getattr(robot.twist, key)) < LEAST_PHASE_RAD:
            yield f"twist.{key}", "smaller: with this delay and lag it would swing"


def _ros2_clashes(link: TwistLinkSection) -> Iterator[tuple[str, str]]:
    if link.kind != "ros2":
        if link.ros2 is not None:
            yield "link.ros2", f"only with kind = 'ros2', not {link.kind!r}"
        return
    if link.port is not None:
        yield "link.port", "none with kind = 'ros2': DDS takes its ports by link.ros2.domain"
    if link.ros2 is None or link.ros2.imu is None:
        yield "link.ros2.imu", NO_IMU
    elif fault := axes_fault(link.ros2.imu_axes):
        yield "link.ros2.imu_axes", fault
