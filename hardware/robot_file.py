"""Robot files: a robot in TOML, checked and turned into SI.

`load_robot("ames")` reads `hardware/robots/ames.toml`, which explains every key.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import pi, radians, sqrt
from pathlib import Path
from types import UnionType
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel, ValidationError

from hardware.dynamics import restoring_in_f
from hardware.plant_parameters import (
    NO_SENSORS,
    BodyImuParameters,
    OdometryParameters,
    PlantIntervals,
    PlantParameters,
    StandParameters,
    StartParameters,
    SuspensionParameters,
)
from hardware.robot_physics import allocation_matrix, faults, led_faults
from hardware.robot_schema import (
    AXES,
    USUAL_PORTS,
    AttitudeSection,
    BatterySection,
    BodyImuSection,
    FlightControllerSection,
    IdentifiedSuspension,
    Interval,
    MavlinkSection,
    R_from_axes,
    RobotSchema,
    Stand,
    Suspension,
    clashes,
)
from hardware.twist_schema import (
    FrankaSection,
    MotionSection,
    Ros2Section,
    TwistRobotSchema,
    arm_of,
    drive_of,
    motion_of,
    twist_clashes,
)
from pipeline.frames import GRAVITY, Array
from pipeline.gains import Gains
from pipeline.robot import AttitudeDrive, Robot, ToldMotion

COMMANDS = ("thrusts", "twist", "attitude")
"""What robots are told, by `[link] takes`."""
BY_GAINS = ("thrusts", "attitude")
"""Those of robots that are led by the PID, whose gains their files have."""
ROBOTS = Path(__file__).parent / "robots"


class RobotFileError(ValueError):
    """A robot file that can't be used.

    Attributes:
        file: Which file.
        key: Where in it, with dots; empty for the whole file.
        allowed: What is wrong and what would be allowed.
    """

    def __init__(self, file: str, key: str, allowed: str) -> None:
        super().__init__(": ".join(filter(None, (file, key, allowed))))
        self.file, self.key, self.allowed = file, key, allowed


@dataclass(frozen=True, slots=True, eq=False)
class Ros2Parameters:
    """Where a robot of ROS 2 listens and speaks: whole names of its topics, a stroke before."""

    domain: int
    command: str
    message: str
    """Twist, TwistStamped or PoseStamped."""
    frame: str
    """Of the header of a TwistStamped; of an arm's base, by whose joints it says where it is."""
    imu: str
    """"": it has none."""
    R_bi: Array
    """(3, 3) from the axes of its motion sensors to the body's."""
    odometry: str
    """"": it tells none."""
    joint_states: str
    """The same."""

    @property
    def takes_pose(self) -> bool:
        """It is told where to be, not how to move."""
        return self.message == "PoseStamped"


@dataclass(frozen=True, slots=True, eq=False)
class FrankaParameters:
    """Where the body b is on an arm of Franka's with an end effector e."""

    R_be: Array
    """(3, 3)."""
    p_be_in_e: Array
    """(3,) of b's origin with respect to e's [m]."""
    real_time: bool
    """The library refuses a kernel without."""


@dataclass(frozen=True, slots=True)
class MavlinkParameters:
    """Who an autopilot is among those who speak MAVLink, and by what it says how it moves."""

    system: int
    component: int
    own_component: int
    """Ours, in its system."""
    twist_from: str
    """ODOMETRY or LOCAL_POSITION_NED."""
    vision: bool = False
    """It is told where a phone that stands sees it."""
    hover_thrust: float | None = None
    """By which, 0 to 1, it hovers; None: 1 is what all its thrusters give."""


@dataclass(frozen=True, slots=True)
class LinkParameters:
    """How the robot is reached, where it listens and what it takes."""

    kind: str
    """A key of `link/registry.py`."""
    stopped_by: str
    """Who stops it in silence, beside its link; "" if nobody is named."""
    host: str
    port: int
    """There, or ours if the robot is the one who calls."""
    max_rise: float
    """How much more a thruster may be told than one command before [N]."""
    takes: str = "thrusts"
    """One of `COMMANDS`."""
    ros2: Ros2Parameters | None = None
    """Of a link of that kind."""
    franka: FrankaParameters | None = None
    """The same."""
    mavlink: MavlinkParameters | None = None
    """The same."""


@dataclass(frozen=True, slots=True, eq=False)
class FlightControllerParameters:
    """How the robot's own computer turns its motors; see `flight_controller/betaflight.py`."""

    motors: tuple[int, ...]
    """Of each thruster, from 1."""
    exponent: float
    """Thrust over f_max is the motor's value to this power."""
    R_bi: Array
    """(3, 3) from the axes of its motion sensors to the body's."""
    gyro_per_deg_s: float
    acc_per_g: float


@dataclass(frozen=True, slots=True)
class BatteryParameters:
    """By which voltages the robot's battery is judged."""

    low_v: float
    empty_v: float


@dataclass(frozen=True, slots=True, eq=False)
class RobotFile:
    """A robot."""

    robot: Robot
    plant: PlantParameters
    """Of one that takes a twist: its motion sensors; it has no thrusters, and mass says nothing."""
    start: StartParameters
    gains: Mapping[str, Gains]
    link: LinkParameters
    keeps_attitude_in_ramp: bool
    """The robot itself, without a word from control."""
    flight_controller: FlightControllerParameters | None = None
    battery: BatteryParameters | None = None
    """None: its voltage is told as it is, and judged by nobody."""

    def reached(self, host: str, port: int, kind: str | None = None) -> RobotFile:
        """The same robot, listening elsewhere, or by another kind of link."""
        link = replace(self.link, host=host, port=port, kind=kind or self.link.kind)
        return replace(self, link=link)


def load_robot(name_or_path: str | Path, takes: Sequence[str] = ("thrusts",)) -> RobotFile:
    """The robot called so, or in the file at that path (ending in `.toml`).

    `takes`: which commands the caller knows; whoever does not say so knows thrusts alone.

    Raises:
        RobotFileError: names file, key and what is allowed.
    """
    path = robot_path(name_or_path)
    robot_file = robot_of(robot_table(path), str(path))
    if robot_file.link.takes not in takes:
        allowed = f"{robot_file.link.takes!r}; here only robots that take {' or '.join(takes)}"
        raise RobotFileError(str(path), "link.takes", allowed)
    return robot_file


def robot_table(path: Path) -> dict[str, Any]:
    """Table of a robot file, unchecked.

    Raises:
        RobotFileError: it can't be read, or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotFileError(str(path), "", error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise RobotFileError(str(path), "", "not a text file in UTF-8") from error
    except ValueError as error:  # also a number of more digits than Python reads
        raise RobotFileError(str(path), "", str(error)) from error
    except RecursionError as error:
        raise RobotFileError(str(path), "", "tables or lists within too many others") from error


def robot_of(table: Mapping[str, Any], file: str) -> RobotFile:
    """The robot that a file's table describes.

    Raises:
        RobotFileError: names `file`, key and what is allowed.
    """
    link = table.get("link")
    takes = link.get("takes") if isinstance(link, Mapping) else None
    if takes == "twist":
        return _twist_robot_of(table, file)
    if "twist" in table and takes not in ("thrusts", "attitude"):
        said = "missing" if takes is None else repr(takes)
        raise RobotFileError(file, "link.takes", f"{said}; allowed with [twist]: 'twist'")
    try:
        schema = RobotSchema.model_validate(table)
    except ValidationError as error:
        raise _explained(file, error, RobotSchema) from error
    for key, reason in clashes(schema):
        raise RobotFileError(file, key, reason)
    robot_file = _converted(schema)
    for key, reason in faults(robot_file.robot, robot_file.plant):
        raise RobotFileError(file, key, reason)
    return robot_file


def _twist_robot_of(table: Mapping[str, Any], file: str) -> RobotFile:
    try:
        schema = TwistRobotSchema.model_validate(table)
    except ValidationError as error:
        raise _explained(file, error, TwistRobotSchema) from error
    for key, reason in twist_clashes(schema):
        raise RobotFileError(file, key, reason)
    robot_file = _converted_twist(schema, Path(file).parent)
    for key, reason in led_faults(robot_file.robot.leds_in_b):
        raise RobotFileError(file, key, reason)
    return robot_file


def robot_path(name_or_path: str | Path) -> Path:
    """The file of the robot called so, or that path if it ends in `.toml`.

    Raises:
        RobotFileError: no such robot; says which there are.
    """
    path = Path(name_or_path)
    if path.suffix == ".toml":
        return path
    known = sorted(file.stem for file in ROBOTS.glob("*.toml"))
    if str(name_or_path) not in known:
        raise RobotFileError(
            str(name_or_path), "", f"no such robot; allowed: {_named(str(name_or_path), known)}"
        )
    return ROBOTS / f"{path}.toml"


def is_shipped(name_or_path: str | Path) -> bool:
    """Whether it is one of this project's robots, as they come.

    Raises:
        RobotFileError: no such robot; says which there are.
    """
    return robot_path(name_or_path).resolve().parent == ROBOTS.resolve()


def _named(wrong: str, known: list[str]) -> str:
    close = get_close_matches(wrong, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return f"{', '.join(known)} or a path ending in .toml{hint}"


def _explained(
    file: str, error: ValidationError, schema: type[RobotSchema] | type[TwistRobotSchema]
) -> RobotFileError:
    """The first fault; a misspelt key comes before the one that is then missing."""
    faults = error.errors()
    fault = next((f for f in faults if f["type"] == "extra_forbidden"), faults[0])
    where = fault["loc"]
    key, reason = ".".join(map(str, where)), str(fault["msg"])
    if fault["type"] in ("extra_forbidden", "missing"):
        known = _keys_at(schema, where[:-1])
        close = get_close_matches(str(where[-1]), known, n=1)
        hint = f"; did you mean {close[0]!r}?" if close and fault["type"] != "missing" else ""
        kind = "missing" if fault["type"] == "missing" else "unknown key"
        reason = f"{kind}{hint}; allowed here: {', '.join(known)}"
    else:
        reason = f"{reason}, not {fault['input']!r}"
    return RobotFileError(file, key, reason)


def _keys_at(schema: type[BaseModel], where: tuple[int | str, ...]) -> list[str]:
    """Keys of the section at a place of the file."""
    section: Any = schema
    for step in where:
        if isinstance(section, type) and issubclass(section, BaseModel):
            section = section.model_fields[str(step)].annotation
        else:  # list[X] or dict[str, X]
            section = get_args(section)[-1]
        if isinstance(section, UnionType):  # X | None
            section = get_args(section)[0]
    return list(section.model_fields)


def _converted_twist(schema: TwistRobotSchema, folder: Path) -> RobotFile:
    link, start, drive = schema.link, schema.start, drive_of(schema.twist)
    motion = motion_of(schema.motion) if schema.motion is not None else None
    nowhere = np.zeros((0, 3))
    plant = PlantParameters(
        mass=0.0,
        inertia=np.zeros(3),
        suspension=None,
        stand=None,
        air_damping=0.0,
        air_damping_rotation=0.0,
        thruster_positions_in_b=nowhere,
        thruster_directions_in_b=nowhere,
        thruster_torques=np.zeros(0),
        f_max=0.0,
        lag=drive.lag_s,
        delay=drive.delay_s,
        imu=NO_SENSORS if schema.body_imu is None else _imu(schema.body_imu),
        odometry=_odometry(schema.motion, motion),
        slip=motion.slip if motion is not None else 0.0,
        arm=arm_of(schema.arm, folder) if schema.arm is not None else None,
    )
    robot = Robot(
        name=schema.name,
        leds_in_b=np.array([led.position_in_body_m for led in schema.leds]),
        A=np.zeros((6, 0)),
        f_min=0.0,
        f_max=0.0,
        mass=plant.mass,
        inertia=plant.inertia,
        axes=np.array([axis in schema.axes for axis in AXES]),
        hangs=False,
        ramp_s=drive.stop_s,
        blinks=schema.blinks,
        tool=schema.tool.name if schema.tool is not None else "",
        twist=drive,
        motion=motion,
    )
    port = link.port or USUAL_PORTS[link.kind]
    return RobotFile(
        robot,
        plant,
        StartParameters(start.distance_m, start.above_m, start.lift_m),
        {},
        LinkParameters(
            link.kind,
            link.stopped_by or "",
            link.host,
            port,
            0.0,
            link.takes,
            _ros2(link.ros2) if link.kind == "ros2" else None,
            _franka(link.franka),
            _mavlink(link.mavlink) if link.kind == "mavlink" else None,
        ),
        keeps_attitude_in_ramp=False,
        battery=_battery(schema.battery),
    )


def _converted(schema: RobotSchema) -> RobotFile:
    body, units, start = schema.body, schema.thrusters.units, schema.start
    positions = np.array([unit.position_in_body_m for unit in units])
    directions = np.array([unit.direction_in_body for unit in units])
    torques = schema.thrusters.torque_per_thrust_m * np.array([float(u.spin) for u in units])
    plant = PlantParameters(
        mass=body.mass_kg,
        inertia=np.array(body.inertia_kg_m2),
        suspension=_suspension(schema.suspension),
        stand=_stand(schema.stand),
        air_damping=schema.air.damping_n_s_m,
        air_damping_rotation=schema.air.damping_n_m_s,
        thruster_positions_in_b=positions,
        thruster_directions_in_b=directions,
        thruster_torques=torques,
        f_max=schema.thrusters.f_max_n,
        lag=schema.thrusters.lag_s,
        delay=schema.thrusters.delay_s,
        imu=_imu(schema.body_imu),
        intervals=_intervals(schema),
    )
    stiffness_in_f, damping_in_f = restoring_in_f(plant)
    robot = Robot(
        name=schema.name,
        leds_in_b=np.array([led.position_in_body_m for led in schema.leds]),
        A=allocation_matrix(positions, directions, torques),
        f_min=schema.thrusters.f_min_n,
        f_max=schema.thrusters.f_max_n,
        mass=body.mass_kg,
        inertia=np.array(body.inertia_kg_m2),
        axes=np.array([axis in schema.axes for axis in AXES]),
        hangs=schema.suspension is not None,
        ramp_s=_ramp_s(schema),
        blinks=schema.blinks,
        tool=schema.tool.name if schema.tool is not None else "",
        stiffness_in_f=stiffness_in_f,
        damping_in_f=damping_in_f,
        thrust_lag_s=plant.lag,
        thrust_delay_s=plant.delay,
        attitude=_attitude(schema.attitude),
    )
    gains = {
        name: Gains(np.array(rows.Kp), np.array(rows.Ki), np.array(rows.Kd))
        for name, rows in schema.gains.items()
    }
    link = LinkParameters(
        schema.link.kind,
        schema.link.stopped_by or "",
        schema.link.host,
        schema.link.port or USUAL_PORTS[schema.link.kind],
        schema.link.max_rise_per_command_n,
        schema.link.takes,
        mavlink=_mavlink(schema.link.mavlink) if schema.link.kind == "mavlink" else None,
    )
    return RobotFile(
        robot,
        plant,
        StartParameters(start.distance_m, start.above_m, start.lift_m),
        gains,
        link,
        schema.keeps_attitude_in_ramp,
        _flight_controller(schema.flight_controller),
        _battery(schema.battery),
    )


def _intervals(schema: RobotSchema) -> PlantIntervals:
    """Those of numbers that are still what was identified; a changed one has none."""
    body, told, thrusters = schema.body, schema.identified, schema.thrusters
    outdated = []

    def half(key: str, interval: Interval | None, value: float) -> float | None:
        if interval is None or interval.found == value:
            return None if interval is None else interval.half_95
        outdated.append(key)
        return None

    air, cable = schema.air, schema.suspension
    roll, pitch, yaw = body.inertia_kg_m2
    inertia = (
        half("body.inertia_kg_m2.0", told.body.inertia_roll_kg_m2, roll),
        half("body.inertia_kg_m2.1", told.body.inertia_pitch_kg_m2, pitch),
        half("body.inertia_kg_m2.2", told.body.inertia_yaw_kg_m2, yaw),
    )
    found = PlantIntervals(
        mass=half("body.mass_kg", told.body.mass_kg, body.mass_kg),
        inertia=inertia,
        air_damping=half("air.damping_n_s_m", told.air.damping_n_s_m, air.damping_n_s_m),
        air_damping_rotation=half("air.damping_n_m_s", told.air.damping_n_m_s, air.damping_n_m_s),
        lag=half("thrusters.lag_s", told.thrusters.lag_s, thrusters.lag_s),
        delay=half("thrusters.delay_s", told.thrusters.delay_s, thrusters.delay_s),
    )
    if cable is not None:
        of = told.suspension or IdentifiedSuspension()
        found = replace(
            found,
            length=half("suspension.length_m", of.length_m, cable.length_m),
            stiffness=half("suspension.stiffness_n_m", of.stiffness_n_m, cable.stiffness_n_m),
            damping=half("suspension.damping_n_s_m", of.damping_n_s_m, cable.damping_n_s_m),
            hook_above_com=half(
                "suspension.hook_above_com_m", of.hook_above_com_m, cable.hook_above_com_m
            ),
        )
    return replace(found, outdated=tuple(outdated))


def _battery(section: BatterySection | None) -> BatteryParameters | None:
    return None if section is None else BatteryParameters(section.low_v, section.empty_v)


def _flight_controller(
    section: FlightControllerSection | None,
) -> FlightControllerParameters | None:
    if section is None:
        return None
    return FlightControllerParameters(
        tuple(section.motors),
        section.thrust_exponent,
        R_from_axes(section.imu_axes),
        section.gyro_per_deg_s,
        section.acc_per_g,
    )


def _ros2(section: Ros2Section | None) -> Ros2Parameters:
    section = section or Ros2Section.model_validate({})
    below = "/" + "".join(f"{part}/" for part in section.namespace.split("/") if part)

    def whole(name: str) -> str:
        return name if name[0] == "/" else below + name

    return Ros2Parameters(
        domain=section.domain,
        command=whole(section.command),
        message=section.message,
        frame=section.frame,
        imu=whole(section.imu) if section.imu is not None else "",
        R_bi=R_from_axes(section.imu_axes),
        odometry=whole(section.odometry) if section.odometry is not None else "",
        joint_states=whole(section.joint_states) if section.joint_states is not None else "",
    )


def _franka(section: FrankaSection | None) -> FrankaParameters | None:
    if section is None:
        return None
    R_be = R_from_axes(section.ee_axes)
    return FrankaParameters(R_be, np.array(section.body_in_ee_m), section.real_time)


def _mavlink(section: MavlinkSection | None) -> MavlinkParameters:
    section = section or MavlinkSection.model_validate({})
    return MavlinkParameters(
        section.system,
        section.component,
        section.own_component,
        section.twist_from,
        section.vision,
        section.hover_thrust,
    )


def _attitude(section: AttitudeSection | None) -> AttitudeDrive | None:
    if section is None:
        return None
    return AttitudeDrive(
        max_tilt=radians(section.max_tilt_deg),
        yaw_rate=radians(section.yaw_rate_deg_s),
        lag_s=section.lag_s,
        delay_s=section.delay_s,
        yaw_lag_s=section.yaw_lag_s,
    )


def _ramp_s(schema: RobotSchema) -> float:
    suspension = schema.suspension
    if suspension is None:
        assert schema.ramp_s is not None
        return schema.ramp_s
    return 2.0 * pi * sqrt((suspension.length_m + suspension.hook_above_com_m) / GRAVITY)


def _suspension(section: Suspension | None) -> SuspensionParameters | None:
    if section is None:
        return None
    return SuspensionParameters(
        section.length_m, section.stiffness_n_m, section.damping_n_s_m, section.hook_above_com_m
    )


def _stand(section: Stand | None) -> StandParameters | None:
    if section is None:
        return None
    return StandParameters(np.array(section.feet_in_body_m), section.friction)


def _odometry(
    section: MotionSection | None, motion: ToldMotion | None
) -> OdometryParameters | None:
    if section is None or motion is None or not motion.is_measured:
        return None
    return OdometryParameters(
        motion.interval_s, section.latency_s, motion.noise_v, motion.noise_omega
    )


def _imu(section: BodyImuSection) -> BodyImuParameters:
    return BodyImuParameters(
        gyro_noise=radians(section.gyro_noise_deg_s_rthz),
        acc_noise=1e-6 * GRAVITY * section.acc_noise_ug_rthz,
        gyro_bias=radians(section.gyro_bias_deg_s),
        acc_bias=1e-3 * GRAVITY * section.acc_bias_mg,
        gyro_step=radians(section.gyro_step_deg_s),
        acc_step=1e-3 * GRAVITY * section.acc_step_mg,
    )
