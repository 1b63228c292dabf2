"""Schema of robot files: every key, its unit in its name, its range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from pipeline.frames import GRAVITY, Array

Axis = Literal["x", "y", "z", "roll", "pitch", "yaw"]
AXES: tuple[Axis, ...] = get_args(Axis)

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Row = Annotated[list[Annotated[float, Field(ge=0.0, le=1e4)]], Field(min_length=6, max_length=6)]


class Section(BaseModel):
    """A table of the file: no other keys, no other types, only finite numbers."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Body(Section):
    """[body]."""

    mass_kg: Annotated[float, Field(gt=0.05, le=100.0)]
    inertia_kg_m2: Annotated[
        list[Annotated[float, Field(gt=1e-6, le=100.0)]], Field(min_length=3, max_length=3)
    ]
    """Principal moments about the body axes."""


class Suspension(Section):
    """[suspension]."""

    length_m: Annotated[float, Field(gt=0.1, le=20.0)]
    """Anchor to hook with the robot hanging at rest."""
    stiffness_n_m: Annotated[float, Field(gt=0.1, le=1e5)]
    damping_n_s_m: Annotated[float, Field(ge=0.0, le=1e3)]
    hook_above_com_m: Annotated[float, Field(ge=0.0, le=1.0)]


class Stand(Section):
    """[stand]: of a robot that stands on the floor."""

    feet_in_body_m: Annotated[list[Vector], Field(min_length=3, max_length=16)]
    """Where they touch the floor."""
    friction: Annotated[float, Field(ge=0.0, le=2.0)]


class Start(Section):
    """[start]: of a simulated flight."""

    distance_m: Annotated[float, Field(ge=0.3, le=10.0)] = 2.5
    above_m: Annotated[float, Field(ge=-2.0, le=3.0)] = 0.0
    """The phone over the robot, which it looks at."""
    lift_m: Annotated[float, Field(ge=0.0, le=2.0)] = 0.0
    """How far the hand rises to take off."""


class Air(Section):
    """[air]: damping of motion through it."""

    damping_n_s_m: Annotated[float, Field(ge=0.0, le=100.0)]
    damping_n_m_s: Annotated[float, Field(ge=0.0, le=10.0)]


class Thruster(Section):
    """[[thrusters.units]]."""

    position_in_body_m: Vector
    direction_in_body: Vector
    """Unit vector of the force on the body."""
    spin: Literal[1, -1]
    """+1: the body feels the reaction torque along the direction, −1: against it."""


class Thrusters(Section):
    """[thrusters]."""

    f_min_n: Annotated[float, Field(ge=0.0, le=100.0)]
    f_max_n: Annotated[float, Field(gt=0.0, le=100.0)]
    torque_per_thrust_m: Annotated[float, Field(ge=0.0, le=0.5)]
    lag_s: Annotated[float, Field(gt=0.0, le=1.0)]
    delay_s: Annotated[float, Field(ge=0.0, le=0.5)]
    units: Annotated[list[Thruster], Field(min_length=2, max_length=16)]


class AttitudeSection(Section):
    """[attitude]: how a robot that takes attitude and thrust follows them."""

    max_tilt_deg: Annotated[float, Field(ge=2.0, le=45.0)]
    """It may be told to lean so far."""
    yaw_rate_deg_s: Annotated[float, Field(gt=0.0, le=360.0)]
    """Largest."""
    lag_s: Annotated[float, Field(gt=0.0, le=1.0)]
    """From a tilt told to the body's: the time constants of two equal lags together."""
    delay_s: Annotated[float, Field(ge=0.0, le=0.5)]
    """From a command to its beginning."""
    yaw_lag_s: Annotated[float, Field(gt=0.0, le=1.0)]
    """Time constant of a yaw rate."""


class BodyImuSection(Section):
    """[body_imu]: of one axis."""

    gyro_noise_deg_s_rthz: NotNegative
    acc_noise_ug_rthz: NotNegative
    gyro_bias_deg_s: NotNegative
    """Standard deviation of what it is wrong by after a start."""
    acc_bias_mg: NotNegative
    gyro_step_deg_s: NotNegative
    """Rounded to multiples of this; 0 not at all."""
    acc_step_mg: NotNegative


class LedSection(Section):
    """[[leds]]; at most one of the three reaches, which `robot leds --improve` may use."""

    position_in_body_m: Vector
    reach_m: Positive | None = None
    """It may be moved so far."""
    reach_box_m: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = None
    """It may be anywhere between these two corners in the body's axes."""
    reach_segment_m: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = None
    """It may be anywhere on the straight arm between these two places in the body's axes."""

    @model_validator(mode="after")
    def _one_reach(self) -> LedSection:
        said = [self.reach_m, self.reach_box_m, self.reach_segment_m]
        if sum(reach is not None for reach in said) > 1:
            raise ValueError("at most one of reach_m, reach_box_m, reach_segment_m")
        return self


class GainsSection(Section):
    """[gains.NAME], over (x, y, z, roll, pitch, yaw); of axes let alone nobody reads them."""

    Kp: Row
    """[N/m, N m/rad]."""
    Ki: Row
    """[N/(m s), N m/(rad s)]."""
    Kd: Row
    """[N s/m, N m s/rad]."""


class MavlinkSection(Section):
    """[link.mavlink]: who an autopilot is, and how it says that it moves; see `link/mavlink/`."""

    system: Annotated[int, Field(ge=1, le=255)] = 1
    """MAV_SYSID, SYSID_THISMAV."""
    component: Annotated[int, Field(ge=1, le=255)] = 1
    """MAV_COMP_ID_AUTOPILOT1."""
    own_component: Annotated[int, Field(ge=1, le=255)] = 191
    """Ours in that system: MAV_COMP_ID_ONBOARD_COMPUTER."""
    twist_from: Literal["LOCAL_POSITION_NED", "ODOMETRY"] = "LOCAL_POSITION_NED"
    """The first with ATTITUDE or ATTITUDE_QUATERNION beside."""
    vision: bool = False
    """It is told where a phone that stands sees it."""
    hover_thrust: Annotated[float, Field(ge=0.05, le=0.95)] | None = None
    """The thrust, 0 to 1, by which it hovers: MPC_THR_HOVER, MOT_THST_HOVER. Of a robot that takes
    `attitude`; without it 1 is that of all its thrusters."""


USUAL_PORTS = {"franka": 1337, "mavlink": 14540, "ros2": 7400, "rpit": 31415}
"""Ports of kinds of links that have one which everybody uses: franka's of TCP, others of UDP."""


class LinkSection(Section):
    """[link]: how control reaches the robot; see `link/registry.py`."""

    kind: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,32}$")] = "udp"
    """`udp` is our own link, `rpit` RPIt's; others by the entry points `lightleash.followers`."""
    takes: Literal["thrusts", "attitude"] = "thrusts"
    """What the robot is told: `attitude` is roll, pitch, yaw rate and thrust; files of those that
    take a `twist` have `twist_schema.py`."""
    stopped_by: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Who or what stops the robot when it hears nothing, if its link does not see to that."""
    host: Annotated[str, Field(min_length=1, max_length=253)]
    """The robot's; with `rpit` 0.0.0.0 is whoever speaks first."""
    port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Where the robot listens; with `rpit`, where we do. May be missing if it has a usual one."""
    max_rise_per_command_n: Positive
    """Of each thruster; of one that takes `attitude` of all together."""
    mavlink: MavlinkSection | None = None


Direction = Literal["x", "y", "z", "-x", "-y", "-z"]


class FlightControllerSection(Section):
    """[flight_controller]: what turns the motors, if the robot's own computer asks it by MSP."""

    stopped_by: Annotated[str, Field(min_length=1, max_length=200)]
    """Who or what stops the motors when that computer dies: the flight controller does not."""
    motors: Annotated[list[Annotated[int, Field(ge=1, le=16)]], Field(min_length=2, max_length=16)]
    """Number of the motor of each thruster, in the order of [[thrusters.units]]."""
    thrust_exponent: Annotated[float, Field(ge=0.5, le=4.0)] = 2.0
    """Thrust grows with the motor's value to this power."""
    imu_axes: list[Direction] = ["x", "y", "z"]
    """Along which axis of its motion sensors each of the body's lies."""
    gyro_per_deg_s: Positive = 16.4
    acc_per_g: Positive = 512.0


class BatterySection(Section):
    """[battery]: of a robot that tells its voltage."""

    low_v: Annotated[float, Field(gt=0.0, le=1000.0)]
    """People are told to come to an end."""
    empty_v: Annotated[float, Field(gt=0.0, le=1000.0)]
    """Below it the robot is not armed."""


class Interval(Section):
    """What flights told of a number of the file, as long as it is still that one."""

    found: NotNegative
    half_95: NotNegative
    """Half of its 95 % interval."""


class NarrowInterval(Interval):
    """Of a number that can't be 0."""

    @model_validator(mode="after")
    def _without_zero(self) -> NarrowInterval:
        if self.half_95 >= self.found:
            raise ValueError(f"half_95 below found, {self.found:g}: this can't be 0")
        return self


class IdentifiedBody(Section):
    """[identified.body]."""

    mass_kg: NarrowInterval | None = None
    inertia_roll_kg_m2: NarrowInterval | None = None
    """The first of [body] inertia_kg_m2 ..."""
    inertia_pitch_kg_m2: NarrowInterval | None = None
    inertia_yaw_kg_m2: NarrowInterval | None = None


class IdentifiedSuspension(Section):
    """[identified.suspension]."""

    length_m: NarrowInterval | None = None
    stiffness_n_m: NarrowInterval | None = None
    damping_n_s_m: Interval | None = None
    hook_above_com_m: Interval | None = None


class IdentifiedAir(Section):
    """[identified.air]."""

    damping_n_s_m: Interval | None = None
    damping_n_m_s: Interval | None = None


class IdentifiedThrusters(Section):
    """[identified.thrusters]."""

    lag_s: NarrowInterval | None = None
    delay_s: Interval | None = None


class IdentifiedSection(Section):
    """[identified]: intervals of numbers that stand in the sections of these names."""

    body: IdentifiedBody = IdentifiedBody()
    suspension: IdentifiedSuspension | None = None
    air: IdentifiedAir = IdentifiedAir()
    thrusters: IdentifiedThrusters = IdentifiedThrusters()


class ToolSection(Section):
    """[tool]: what opens and closes by a slider on the phone, as long as the hand leads."""

    name: Annotated[str, Field(min_length=1, max_length=20)]
    """For people's screens."""


class RobotSchema(Section):
    """The file."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_-]{1,32}$")]
    axes: Annotated[list[Axis], Field(min_length=1, max_length=6)] = list(AXES)
    """Controlled, in the body's axes; the others are let alone."""
    ramp_s: Annotated[float, Field(ge=0.05, le=30.0)] | None = None
    """From full thrust to zero; with a suspension its period."""
    keeps_attitude_in_ramp: bool = False
    """By its own gyroscope, while its thrust falls in silence: one that flies must."""
    blinks: bool = False
    """Its LEDs can be told to be dark one by one, so that pictures show whose it is."""
    body: Body
    suspension: Suspension | None = None
    stand: Stand | None = None
    start: Start = Start()
    air: Air
    thrusters: Thrusters
    attitude: AttitudeSection | None = None
    body_imu: BodyImuSection
    leds: Annotated[list[LedSection], Field(min_length=4, max_length=16)]
    gains: Annotated[dict[str, GainsSection], Field(min_length=1)]
    link: LinkSection
    flight_controller: FlightControllerSection | None = None
    battery: BatterySection | None = None
    tool: ToolSection | None = None
    identified: IdentifiedSection = IdentifiedSection()


def clashes(robot: RobotSchema) -> Iterator[tuple[str, str]]:
    """Keys that contradict each other: (key, what would be allowed)."""
    if robot.link.port is None and robot.link.kind not in USUAL_PORTS:
        yield "link.port", f"missing: a link of kind {robot.link.kind!r} has no usual one"
    if robot.flight_controller is not None:
        yield from _miswired(robot.flight_controller, len(robot.thrusters.units))
    yield from battery_clashes(robot.battery)
    yield from _attitude_clashes(robot)
    if len(set(robot.axes)) < len(robot.axes):
        yield "axes", "each word once"
    if robot.suspension is None and robot.identified.suspension is not None:
        yield "identified.suspension", "only with [suspension]"
    if robot.suspension is not None:
        if robot.stand is not None:
            yield "stand", "only without [suspension]: a robot hangs or stands"
        if robot.ramp_s is not None:
            yield "ramp_s", "only without [suspension], whose period it is"
        if robot.keeps_attitude_in_ramp:
            yield "keeps_attitude_in_ramp", "only without [suspension], which keeps it"
        return
    if robot.stand is None:
        yield "stand", "[stand], or [suspension] for a robot that hangs"
    if robot.ramp_s is None:
        yield "ramp_s", "how long a ramp to zero thrust lasts [s]: there is no [suspension]"


def _attitude_clashes(robot: RobotSchema) -> Iterator[tuple[str, str]]:
    """Of what a robot takes, and by which link."""
    link, takes = robot.link, robot.link.takes == "attitude"
    if takes != (robot.attitude is not None):
        yield "attitude", "with link.takes = 'attitude', and with it alone"
    if takes and robot.keeps_attitude_in_ramp:
        yield "keeps_attitude_in_ramp", "only with takes = 'thrusts': it keeps it all the time"
    if takes and robot.flight_controller is not None:
        yield "flight_controller", "only with takes = 'thrusts', which it turns into motors"
    yield from mavlink_clashes(link.kind, link.mavlink)
    hover = link.mavlink.hover_thrust if link.mavlink is not None else None
    most = len(robot.thrusters.units) * robot.thrusters.f_max_n
    if hover is not None and hover * most > robot.body.mass_kg * GRAVITY:
        each = robot.body.mass_kg * GRAVITY / hover / len(robot.thrusters.units)
        yield "thrusters.f_max_n", f"{each:.2f} or less: more is above 1 by hover_thrust"


def mavlink_clashes(kind: str, section: MavlinkSection | None) -> Iterator[tuple[str, str]]:
    """The same of [link.mavlink]."""
    if section is None:
        return
    if kind != "mavlink":
        yield "link.mavlink", f"only with kind = 'mavlink', not {kind!r}"
    if section.own_component == section.component:
        yield "link.mavlink.own_component", "another one than the autopilot's"


def battery_clashes(battery: BatterySection | None) -> Iterator[tuple[str, str]]:
    """The same of [battery]."""
    if battery is not None and battery.empty_v >= battery.low_v:
        yield "battery.empty_v", f"less than low_v, {battery.low_v:g} V"


def _miswired(section: FlightControllerSection, thrusters: int) -> Iterator[tuple[str, str]]:
    if len(section.motors) != thrusters or len(set(section.motors)) < thrusters:
        yield "flight_controller.motors", f"{thrusters} different numbers, one for each thruster"
    if fault := axes_fault(section.imu_axes):
        yield "flight_controller.imu_axes", fault


def R_from_axes(axes: list[Direction]) -> Array:
    """R_bi (3, 3), of sensors along whose axes those of b lie."""
    rows = [(-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])] for axis in axes]
    return np.array(rows)


def axes_from_R(R_bi: Array) -> list[str]:
    """`Direction`s of sensors that are turned by right angles (3, 3): back from `R_from_axes`."""
    which = np.abs(R_bi).argmax(axis=1).tolist()
    return ["-" * int(row[k] < 0.0) + "xyz"[k] for row, k in zip(R_bi, which, strict=True)]


def axes_fault(axes: list[Direction]) -> str:
    """What would be allowed in place of three directions that are no right-handed system, or ""."""
    letters = "".join(axis[-1] for axis in axes)
    if sorted(letters) != ["x", "y", "z"]:
        return "each of x, y, z once, with or without a minus"
    is_even, minuses = letters in "xyzxy", sum(axis[0] == "-" for axis in axes)
    return "" if is_even == (minuses % 2 == 0) else "a right-handed system: turn one minus"
