"""What a simulated robot is made of; read from a robot file by `hardware.robot_file`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.frames import GRAVITY, Array


@dataclass(frozen=True, slots=True)
class BodyImuParameters:
    """Errors of the body's motion sensors, per axis; steps of 0 are no rounding."""

    gyro_noise: float
    """[rad/s/√Hz]."""
    acc_noise: float
    """[m/s²/√Hz]."""
    gyro_bias: float
    """Standard deviation after a start [rad/s]."""
    acc_bias: float
    """[m/s²]."""
    gyro_step: float
    """[rad/s]."""
    acc_step: float
    """[m/s²]."""


NO_SENSORS = BodyImuParameters(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Of a body that has none: nobody asks them."""


@dataclass(frozen=True, slots=True)
class OdometryParameters:
    """How a robot measures its own twist by wheels or joints."""

    interval_s: float
    latency_s: float
    """From measuring to being sent."""
    noise_v: float
    """Of one measured twist [m/s] ..."""
    noise_omega: float
    """... and its angular rate [rad/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmParameters:
    """Joints that move a robot's body, the tip of an arm, and how far they may."""

    model: Path
    """Its MuJoCo model."""
    tip: str
    """Name of the site in it that is b."""
    home: Array
    """(n,) angles of the joints from base to tip, where it begins [rad]."""
    rate: float
    """Largest of each joint [rad/s]."""
    servo_lag_s: float
    """By which its servos follow what they are told."""
    keeps_apart: tuple[tuple[str, str], ...]
    """Names of geoms in it of which no two come nearer to each other than ..."""
    apart: float
    """... this [m]."""
    tool_joint: str
    """Name of the joint that opens its tool, closed at the least of its range; empty: none."""
    tool_stroke_s: float
    """From closed to open."""


@dataclass(frozen=True, slots=True)
class SuspensionParameters:
    """An elastic cable from an anchor straight above."""

    length: float
    """Anchor to hook, hanging at rest [m]."""
    stiffness: float
    """[N/m]."""
    damping: float
    """[N s/m]."""
    hook_above_com: float
    """[m]."""

    def rest_length(self, mass: float) -> float:
        """Shorter than this with a robot of `mass` [kg], the cable is slack [m]."""
        return self.length - mass * GRAVITY / self.stiffness


@dataclass(frozen=True, slots=True, eq=False)
class StandParameters:
    """Feet of a robot that stands on the floor."""

    feet_in_b: Array
    """(k, 3) [m], where they touch."""
    friction: float
    """Sideways force per weight before it slides."""


@dataclass(frozen=True, slots=True)
class StartParameters:
    """How somebody with a phone begins, for simulated phones: looking at the robot."""

    distance: float
    """On the floor, behind the robot [m]."""
    above: float
    """The phone over the robot's centre of mass [m]."""
    lift: float
    """How far the hand rises to take off [m]."""


@dataclass(frozen=True, slots=True)
class PlantIntervals:
    """Half widths of 95 % intervals; None: as no flight told it, or of another value."""

    mass: float | None = None
    """[kg]."""
    inertia: tuple[float | None, float | None, float | None] = (None, None, None)
    """[kg m²]."""
    length: float | None = None
    """Of the suspension [m], as the next three."""
    stiffness: float | None = None
    """[N/m]."""
    damping: float | None = None
    """[N s/m]."""
    hook_above_com: float | None = None
    """[m]."""
    air_damping: float | None = None
    """[N s/m]."""
    air_damping_rotation: float | None = None
    """[N m s]."""
    lag: float | None = None
    """[s]."""
    delay: float | None = None
    """[s]."""
    outdated: tuple[str, ...] = ()
    """Keys of the robot file with another value than the one that was identified."""


@dataclass(frozen=True, slots=True, eq=False)
class PlantParameters:
    """Rigid body of a simulated robot, and what carries it: a suspension or a stand."""

    mass: float
    """[kg]."""
    inertia: Array
    """(3,) principal moments about the body axes [kg m²]."""
    suspension: SuspensionParameters | None
    stand: StandParameters | None
    air_damping: float
    """[N s/m]."""
    air_damping_rotation: float
    """[N m s]."""
    thruster_positions_in_b: Array
    """(m, 3) [m]."""
    thruster_directions_in_b: Array
    """(m, 3) unit vectors."""
    thruster_torques: Array
    """(m,) reaction torque along the direction per thrust [m], signed."""
    f_max: float
    """[N]."""
    lag: float
    """Time constant of a thruster [s]."""
    delay: float
    """From command to thruster [s]."""
    imu: BodyImuParameters
    odometry: OdometryParameters | None = None
    """In place of motion sensors, of a robot that has none and measures its twist."""
    slip: float = 0.0
    """Share of its twist by which its body moves otherwise than its wheels, for a while."""
    arm: ArmParameters | None = None
    """Of a robot whose body is the tip of one."""
    intervals: PlantIntervals = PlantIntervals()
    """Of what was identified."""
