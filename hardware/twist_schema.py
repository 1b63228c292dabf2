"""Schema of files of robots that take a twist: what the others' says of thrusters is missing."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from hardware.plant_parameters import ArmParameters
from hardware.robot_schema import (
    AXES,
    USUAL_PORTS,
    Axis,
    BatterySection,
    BodyImuSection,
    Direction,
    LedSection,
    MavlinkSection,
    Section,
    Start,
    ToolSection,
    Vector,
    axes_fault,
    battery_clashes,
    mavlink_clashes,
)
from pipeline.control.twist_margins import LEAST_PHASE_RAD
from pipeline.robot import ToldMotion, TwistDrive

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


class MotionSection(Section):
    """[motion]: of a robot without motion sensors on its body; what it says of how it moves."""

    twist: Literal["measured", "commanded"]
    """Measured by its wheels or joints; else nobody does, and it is taken to move as told."""
    stands_level: bool
    """Its z axis is up, within ..."""
    tilt_deg: Annotated[float, Field(ge=0.1, le=15.0)] = 2.0
    rate_hz: Annotated[float, Field(ge=5.0, le=200.0)] | None = None
    """How often it measures."""
    latency_s: Annotated[float, Field(ge=0.0, le=0.1)] = 0.02
    """From measuring to being sent, of a simulated robot; a real one says when it measured."""
    noise_m_s: Annotated[float, Field(ge=0.0, le=0.5)] = 0.01
    """Of one measured twist ..."""
    noise_deg_s: Annotated[float, Field(ge=0.0, le=30.0)] = 0.5
    slip_share: Annotated[float, Field(ge=0.0, le=0.5)] | None = None
    """Share of its twist by which it moves otherwise for half a second: wheels on a floor. Usually
    `SLIP`."""
    unlike_s: Annotated[float, Field(ge=0.0, le=0.3)] | None = None
    """By how much its delay and lag may be others than [twist] says; usually `UNLIKE_S`."""


class ArmSection(Section):
    """[arm]: joints that carry the body, by a MuJoCo model."""

    model: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-][A-Za-z0-9_.-]{0,99}\.xml$")]
    """Beside this file."""
    tip: Annotated[str, Field(min_length=1, max_length=100)]
    """Site in it that is the body: its place and its axes."""
    home_deg: Annotated[
        list[Annotated[float, Field(ge=-360.0, le=360.0)]], Field(min_length=1, max_length=12)
    ]
    """Where it begins: of the joints from the base to the tip."""
    joint_speed_deg_s: Annotated[float, Field(gt=0.0, le=720.0)]
    """Largest of each of them."""
    servo_lag_s: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    """By which servos follow the angles that they are told: they are told so much ahead."""
    keeps_apart: Annotated[
        list[Annotated[list[str], Field(min_length=2, max_length=2)]],
        Field(max_length=64, default_factory=list),
    ]
    """Pairs of geoms in it that come no nearer to each other than ..."""
    apart_m: Annotated[float, Field(ge=0.0, le=0.2)] = 0.01
    tool_joint: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    """Joint in it that opens and closes its tool: closed at the least of its range."""
    tool_stroke_s: Annotated[float, Field(ge=0.1, le=60.0)] = 1.0
    """From closed to open."""


SLIP = {"measured": 0.03, "commanded": 0.1}
UNLIKE_S = {"measured": 0.03, "commanded": 0.06}
"""Who measures knows better."""

ROS_NAME = r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"
RosName = Annotated[str, Field(pattern=f"^{ROS_NAME}$", max_length=200)]
"""Of a topic: below the namespace, unless it begins with a stroke."""


NO_IMU = (
    "topic of the base's sensor_msgs/Imu, a gyroscope and an accelerometer, which [body_imu] says"
    " that it has; a base without them says in [motion] what it tells instead"
)
NO_SENSORS = "missing: [body_imu], or [motion] of a robot without motion sensors on its body"
NO_MOTION = "only without [body_imu]: motion sensors tell more"
LEVEL = "false: it is led about {axis}, so it does not stand level"


class Ros2Section(Section):
    """[link.ros2]: where a robot of ROS 2 listens and speaks; see `link/ros2/`."""

    domain: Annotated[int, Field(ge=0, le=232)] = 0
    """ROS_DOMAIN_ID of the robot."""
    namespace: Annotated[str, Field(pattern=f"^(/|{ROS_NAME})$", max_length=200)] = "/"
    command: RosName = "cmd_vel"
    """What it takes ..."""
    message: Literal["Twist", "TwistStamped", "PoseStamped"] = "Twist"
    """... of geometry_msgs; a pose where it says that it is in its odometry's frame."""
    frame: Annotated[str, Field(pattern=r"^[!-~]{1,100}$")] = "base_link"
    """In the header of a TwistStamped; of a PoseStamped by joint_states."""
    imu: RosName | None = None
    """sensor_msgs/Imu, of the body; only of a base with [motion] there is none."""
    imu_axes: Annotated[
        list[Direction], Field(min_length=3, max_length=3, default_factory=lambda: ["x", "y", "z"])
    ]
    """Along which axis of its motion sensors each of the body's lies."""
    odometry: RosName | None = None
    """nav_msgs/Odometry; without it the robot is taken to move as told, after its delay and lag."""
    joint_states: RosName | None = None
    """sensor_msgs/JointState of an arm, in place of odometry: [arm] says what its joints move."""


class FrankaSection(Section):
    """[link.franka]: where the body is on an arm of Franka's; see `link/franka/`."""

    body_in_ee_m: Annotated[Vector, Field(default_factory=lambda: [0.0, 0.0, 0.0])]
    """Origin of the body's axes in those of the end effector, as Franka's Desk has that."""
    ee_axes: Annotated[
        list[Direction], Field(min_length=3, max_length=3, default_factory=lambda: ["x", "y", "z"])
    ]
    """Along which axis of the end effector each of the body's lies."""
    real_time: bool = True
    """Refuse a computer whose kernel has no real time, as Franka demands one."""


class TwistLinkSection(Section):
    """[link] of a robot that takes a twist."""

    kind: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,32}$")] = "udp"
    takes: Literal["twist"]
    stopped_by: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    host: Annotated[str, Field(min_length=1, max_length=253)]
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    ros2: Ros2Section | None = None
    franka: FrankaSection | None = None
    mavlink: MavlinkSection | None = None


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
    body_imu: BodyImuSection | None = None
    motion: MotionSection | None = None
    arm: ArmSection | None = None
    leds: Annotated[list[LedSection], Field(min_length=4, max_length=16)]
    link: TwistLinkSection
    battery: BatterySection | None = None
    tool: ToolSection | None = None


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


def motion_of(section: MotionSection) -> ToldMotion:
    """The section in SI."""
    slip, unlike_s = section.slip_share, section.unlike_s
    return ToldMotion(
        is_measured=section.twist == "measured",
        is_level=section.stands_level,
        tilt=radians(section.tilt_deg),
        interval_s=1.0 / section.rate_hz if section.rate_hz is not None else 0.0,
        noise_v=section.noise_m_s,
        noise_omega=radians(section.noise_deg_s),
        slip=SLIP[section.twist] if slip is None else slip,
        unlike_s=UNLIKE_S[section.twist] if unlike_s is None else unlike_s,
    )


def arm_of(section: ArmSection, folder: Path) -> ArmParameters:
    """The section in SI, of a robot file in `folder`."""
    return ArmParameters(
        model=folder / section.model,
        tip=section.tip,
        home=np.radians(section.home_deg),
        rate=radians(section.joint_speed_deg_s),
        servo_lag_s=section.servo_lag_s,
        keeps_apart=tuple((one, other) for one, other in section.keeps_apart),
        apart=section.apart_m,
        tool_joint=section.tool_joint or "",
        tool_stroke_s=section.tool_stroke_s,
    )


def twist_clashes(robot: TwistRobotSchema) -> Iterator[tuple[str, str]]:
    """Keys that contradict each other: (key, what would be allowed)."""
    if robot.link.port is None and robot.link.kind not in USUAL_PORTS:
        yield "link.port", f"missing: a link of kind {robot.link.kind!r} has no usual one"
    yield from battery_clashes(robot.battery)
    if robot.arm is not None and (robot.arm.tool_joint is None) != (robot.tool is None):
        yield "arm.tool_joint", "with [tool], and with it alone"
    yield from _motion_clashes(robot)
    for kind in ("ros2", "franka"):
        if robot.link.kind != kind and getattr(robot.link, kind) is not None:
            yield f"link.{kind}", f"only with kind = {kind!r}, not {robot.link.kind!r}"
    yield from _ros2_clashes(robot.link, robot.motion, robot.arm)
    yield from _franka_clashes(robot)
    yield from _mavlink_clashes(robot)
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


def _motion_clashes(robot: TwistRobotSchema) -> Iterator[tuple[str, str]]:
    motion = robot.motion
    if motion is None:
        if robot.body_imu is None:
            yield "body_imu", NO_SENSORS
        return
    if robot.body_imu is not None:
        yield "motion", NO_MOTION
    tilting = [axis for axis in robot.axes if axis in ("roll", "pitch")]
    if motion.stands_level and tilting:
        yield "motion.stands_level", LEVEL.format(axis=" and ".join(tilting))
    if motion.twist == "measured" and motion.rate_hz is None:
        yield "motion.rate_hz", "missing: how often it measures its twist"
    if motion.twist == "commanded" and motion.rate_hz is not None:
        yield "motion.rate_hz", "only with twist = 'measured'"


def _mavlink_clashes(robot: TwistRobotSchema) -> Iterator[tuple[str, str]]:
    link, motion = robot.link, robot.motion
    yield from mavlink_clashes(link.kind, link.mavlink)
    if link.kind != "mavlink":
        return
    if tilting := [axis for axis in robot.axes if axis in ("roll", "pitch")]:
        yield "axes", f"without {' and '.join(tilting)}: an autopilot tilts as it must"
    if motion is not None and motion.twist != "measured":
        yield "motion.twist", "'measured': an autopilot says how it moves"
    if link.mavlink is not None and link.mavlink.hover_thrust is not None:
        yield "link.mavlink.hover_thrust", "only with takes = 'attitude'"


def _ros2_clashes(
    link: TwistLinkSection, motion: MotionSection | None, arm: ArmSection | None
) -> Iterator[tuple[str, str]]:
    if link.kind != "ros2":
        return
    if link.port is not None:
        yield "link.port", "none with kind = 'ros2': DDS takes its ports by link.ros2.domain"
    topics = link.ros2 or Ros2Section.model_validate({})
    if motion is None and topics.imu is None:
        yield "link.ros2.imu", NO_IMU
    elif motion is not None and topics.imu is not None:
        yield "link.ros2.imu", "none of a base with [motion], which has no motion sensors"
    elif fault := axes_fault(topics.imu_axes):
        yield "link.ros2.imu_axes", fault
    says = [key for key in ("odometry", "joint_states") if getattr(topics, key) is not None]
    if len(says) > 1:
        yield "link.ros2.joint_states", "none beside odometry: one of them says how it moves"
    if topics.joint_states is not None and arm is None:
        yield "arm", "missing: the model of the arm, by which link.ros2.joint_states move its tip"
    if motion is not None and (motion.twist == "measured") != bool(says):
        is_measured = motion.twist == "measured"
        allowed = "missing: topic of the nav_msgs/Odometry that" if is_measured else "none where"
        key = says[0] if says else "odometry"
        yield f"link.ros2.{key}", f"{allowed} motion.twist = {motion.twist!r}"
    if topics.message == "PoseStamped" and not says:
        yield (
            "link.ros2.message",
            "'PoseStamped' with odometry or joint_states, which say where",
        )


def _franka_clashes(robot: TwistRobotSchema) -> Iterator[tuple[str, str]]:
    link, motion = robot.link, robot.motion
    if link.kind != "franka":
        return
    if link.port is not None:
        yield "link.port", "none with kind = 'franka': its library has one"
    if link.franka is None:
        yield "link.franka", "missing: where the body is on the arm"
    elif fault := axes_fault(link.franka.ee_axes):
        yield "link.franka.ee_axes", fault
    if motion is None or motion.twist != "measured":
        yield "motion.twist", "'measured' with kind = 'franka': its joints tell how it moves"
    if robot.arm is not None:
        yield "arm", "none with kind = 'franka': joints are its controller's"
    if robot.tool is not None:
        yield "tool", "none with kind = 'franka'"
