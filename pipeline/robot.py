"""What the pipeline knows of a robot: where its LEDs and thrusters are, and what they can do."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot, pi

import numpy as np
import numpy.typing as npt

from pipeline.frames import GRAVITY, Array

LATE_S = 0.1
"""On its way a measured twist may be so long."""
ONE_AXIS = 1e-3
"""Forces that share an axis but for this are all along it."""


@dataclass(frozen=True, slots=True)
class TwistDrive:
    """How a robot that takes a twist, velocity and angular rate of its body, may be driven."""

    speed: float
    """Largest [m/s]."""
    acceleration: float
    """[m/s²], braking included."""
    rate: float
    """Largest angular one [rad/s]."""
    angular_acceleration: float
    """[rad/s²]."""
    position_gain: float
    """Speed per distance to where it should be [1/s]."""
    attitude_gain: float
    """Angular rate per angle to where it should be [1/s]."""
    lag_s: float
    """From a twist to the body's motion: time constant ..."""
    delay_s: float
    """... and from a command to its beginning [s]."""

    @property
    def stop_s(self) -> float:
        """From its largest twist to none [s]."""
        return max(self.speed / self.acceleration, self.rate / self.angular_acceleration)

    def phase_margin(self, gain: float) -> float:
        """Of the loop gain / s · lag · delay [rad], which crosses over at about `gain` [1/s]."""
        return 0.5 * pi - gain * (self.lag_s + self.delay_s)

    def within(self, twist_in_b: Array) -> Array:
        """The twist (6,) in b of the same directions that is no larger than is allowed."""
        v, omega = _halves(twist_in_b)
        return np.concatenate((_shortened(v, self.speed), _shortened(omega, self.rate)))

    def toward(self, before: Array, wanted: Array, seconds: float) -> Array:
        """From the twist `before` (6,) in b to the one wanted, as far as `seconds` allow."""
        most = self.acceleration * seconds, self.angular_acceleration * seconds
        v, omega = _halves(wanted - before)
        change = np.concatenate((_shortened(v, most[0]), _shortened(omega, most[1])))
        return wanted.copy() if (change == wanted - before).all() else before + change

    def exceeds(self, twist_in_b: Array, rounding: float = 1.0) -> bool:
        """Whether a twist (6,) is larger than is allowed by more than a factor of rounding."""
        v, omega = (float(np.linalg.norm(half)) for half in _halves(twist_in_b))
        return v > self.speed * rounding or omega > self.rate * rounding


@dataclass(frozen=True, slots=True)
class AttitudeDrive:
    """How a robot that takes attitude and thrust follows its tilt and its yaw rate."""

    max_tilt: float
    """It may be told to lean so far [rad]."""
    yaw_rate: float
    """Largest [rad/s]."""
    lag_s: float
    """From a tilt told to the body's: two equal lags behind each other, both together ..."""
    delay_s: float
    """... and from a command to its beginning [s]."""
    yaw_lag_s: float
    """Time constant by which it follows a yaw rate, after the same delay."""

    def within(self, roll: float, pitch: float, yaw_rate: float) -> Array:
        """The same (3,) [rad, rad, rad/s], no farther and no faster than it may be told."""
        leans = hypot(roll, pitch)
        share = 1.0 if leans <= self.max_tilt else self.max_tilt / leans
        turns = min(max(yaw_rate, -self.yaw_rate), self.yaw_rate)
        return np.array([share * roll, share * pitch, turns])

    def exceeds(self, roll: float, pitch: float, yaw_rate: float, rounding: float = 1.0) -> bool:
        """Whether it leans farther or turns faster than allowed by more than a factor."""
        leans = hypot(roll, pitch) > self.max_tilt * rounding
        return leans or abs(yaw_rate) > self.yaw_rate * rounding


@dataclass(frozen=True, slots=True)
class ToldMotion:
    """How a robot without motion sensors says how its body moves, and how wrong that may be."""

    is_measured: bool
    """By its wheels or joints; else it moves as told, for all that anybody knows."""
    is_level: bool
    """Its z axis is up; else the phone says where that is."""
    tilt: float
    """How far from level it may stand [rad]."""
    interval_s: float
    """Between two measured twists."""
    noise_v: float
    """Of one of them [m/s] ..."""
    noise_omega: float
    """... and of its angular rate [rad/s]."""
    slip: float
    """Share of its twist by which it may move otherwise, for a while."""
    unlike_s: float
    """By so much its delay and lag together may differ from those of its drive."""

    @property
    def lasts_s(self) -> float:
        """So old a measured twist may be and still tell how it moves."""
        return 2.5 * self.interval_s + LATE_S


def _halves(twist: Array) -> tuple[Array, Array]:
    return twist[:3], twist[3:]


def _shortened(v: Array, limit: float) -> Array:
    length = float(np.linalg.norm(v))
    return v if length <= limit else limit / length * v


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """Geometry and limits; read from a robot file by `hardware.robot_file`."""

    name: str
    leds_in_b: Array
    """(n, 3) [m], from the centre of mass."""
    A: Array
    """(6, m): wrench in b (force [N], torque about the centre of mass [N m]) = A @ thrusts."""
    f_min: float
    """Least thrust of a running thruster [N]."""
    f_max: float
    """[N]."""
    mass: float
    """[kg]."""
    inertia: Array
    """(3,) principal moments about the axes of b [kg m²]."""
    axes: npt.NDArray[np.bool_]
    """(6,) which of x, y, z, roll, pitch, yaw (in b) are controlled; the others are let alone."""
    hangs: bool
    """False: with its thrusters off it stands on the floor."""
    ramp_s: float
    """How long a ramp to zero lasts; hanging, the pendulum's period: that leaves no swing."""
    blinks: bool = False
    """Its LEDs can be told to be dark one by one."""
    stiffness_in_f: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) how hard what it hangs from pulls it back to its rest, along x, y, z [N/m]; zeros:
    nothing does."""
    damping_in_f: Array = field(default_factory=lambda: np.zeros(3))
    """(3,) how air and cable brake it [N s/m]."""
    thrust_lag_s: float = 0.025
    """Of a thruster, first order ..."""
    thrust_delay_s: float = 0.015
    """... and from a command to its beginning [s]."""
    twist: TwistDrive | None = None
    """Of a robot that takes a twist: it has no thrusters (m = 0), and who drives it carries it, so
    that mass and inertia count for nothing."""
    attitude: AttitudeDrive | None = None
    """Of a robot that takes attitude and thrust: its thrusters are told nothing, and who keeps its
    attitude turns them."""
    motion: ToldMotion | None = None
    """Of one that has no motion sensors on its body: its twist stands for them."""
    tool: str = ""
    """What people call its tool, which opens and closes; empty: it has none."""

    @property
    def blinking_leds(self) -> int:
        """How many can be told to be dark: all or none."""
        return len(self.leds_in_b) if self.blinks else 0

    @property
    def weight_to_carry(self) -> float:
        """What its thrusters must carry [N]; neither cable nor floor does."""
        carries = self.axes[2] and not self.hangs and self.twist is None
        return self.mass * GRAVITY if carries else 0.0

    @property
    def needs_tilt(self) -> bool:
        """Whether it can only go sideways by tilting: all its forces are along one axis of b."""
        spread = np.linalg.svd(self.A[:3], compute_uv=False)
        return bool(spread[1] < ONE_AXIS * spread[0] and self.axes[:2].any())

    @property
    def wrench_axes(self) -> npt.NDArray[np.bool_]:
        """(6,) rows of A that its thrusters must be able to give both ways."""
        if not self.needs_tilt:
            return self.axes
        tilting = np.array([False, False, True, True, True, False])
        kept: npt.NDArray[np.bool_] = tilting | (self.axes & ~np.array([True, True, *4 * [False]]))
        return kept

    @property
    def loop_axes(self) -> npt.NDArray[np.bool_]:
        """(6,) which axes' loops control closes, roll and pitch of one that tilts among them."""
        return self.axes if self.attitude is not None else self.axes | self.wrench_axes


def lift_mixer(A: Array) -> Array:
    """(m, 4) the least thrusts per lift [N] along b's z axis and torque [N m], by A (6, m)."""
    return np.linalg.pinv(A[2:]).astype(np.float64)
