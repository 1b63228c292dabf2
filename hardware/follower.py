"""The interface to every robot, real or simulated: commands in, samples of its body sensors out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, runtime_checkable

import numpy as np

from pipeline.estimation.standing_camera import StandingPose
from pipeline.frames import Array
from pipeline.robot import AttitudeDrive, Robot, TwistDrive

ROUNDING = 1.0 + 1e-6
"""Commands travel as float32: by this factor they may be larger than they were."""

ATTITUDE_VALUES = 4  # of an `AttitudeCommand`
LIFT = slice(3, 4)  # which of them is the thrust

NOT_MEASURED = -1.0
"""Age of a twist that nobody measured [s]."""


class FollowerError(RuntimeError):
    """A follower can't do what it was asked.

    Attributes:
        what: What failed.
        allowed: What would have been allowed, or how to mend it.
    """

    def __init__(self, what: str, allowed: str) -> None:
        super().__init__(f"{what}: {allowed}")
        self.what, self.allowed = what, allowed


class FollowerState(IntEnum):
    """State of the robot, by itself."""

    IDLE = 0
    """Ready; no thrust."""
    RUNNING = 1
    """Follows the commands."""
    RAMP = 2
    """Heard nothing it could accept: goes down to zero by itself."""
    REFUSING = 3
    """No thrust until it has seen zero of a new epoch for half a second."""
    COAST = 4
    """Hears nothing for the moment: keeps its attitude, lets the thrust fade, may come back."""
    STOPPED_BY_WIRE = 5
    """Its emergency stop is pressed, or was: no thrust until then and zero of a new epoch."""


STOPPED = (FollowerState.REFUSING, FollowerState.STOPPED_BY_WIRE)
"""Without thrust until zero of a new epoch."""


class EStop(IntEnum):
    """What a robot's emergency stop says: a wire that is closed while nobody presses."""

    NOT_WIRED = 0
    CLOSED = 1
    OPEN = 2
    """Pressed, or the wire is broken."""


class Refusal(IntEnum):
    """Why the robot does not follow, or did not take the last command; see `EXPLANATIONS`."""

    NONE = 0
    STARTED = 1
    SILENT = 2
    MALFORMED = 3
    THRUSTERS = 4
    NONCE = 5
    STALE = 6
    EPOCH = 7
    COUNTER = 8
    NOT_FINITE = 9
    LIMITS = 10
    RISE = 11
    ZERO_FIRST = 12
    HANDSHAKE = 13
    WIRE = 14
    FAULT = 15
    NOT_ARMED = 16
    MODE = 17


EXPLANATIONS: dict[Refusal, str] = {
    Refusal.NONE: "",
    Refusal.STARTED: "The robot has just started: it waits to be told zero.",
    Refusal.SILENT: "The robot heard no valid command in time and went to zero by itself.",
    Refusal.MALFORMED: "The robot received something that is no command.",
    Refusal.THRUSTERS: "The command is for another number of thrusters: is it another robot?",
    Refusal.NONCE: "The command answers nothing the robot has lately sent.",
    Refusal.STALE: "Commands reach the robot too late.",
    Refusal.EPOCH: "The command is of another control process than the robot follows.",
    Refusal.COUNTER: "The command is old, repeated or far ahead.",
    Refusal.NOT_FINITE: "A command is not a number.",
    Refusal.LIMITS: "A command is beyond the robot's limits.",
    Refusal.RISE: "A command changes faster than the robot allows.",
    Refusal.ZERO_FIRST: "A new control process must begin with zero.",
    Refusal.HANDSHAKE: "The robot is still making sure that it is told zero.",
    Refusal.WIRE: "The robot's emergency stop was pressed.",
    Refusal.FAULT: "The robot's own controller has stopped it.",
    Refusal.NOT_ARMED: "The autopilot is not armed: only its pilot can do that.",
    Refusal.MODE: "The autopilot follows nobody: its pilot has not set OFFBOARD or GUIDED.",
}
"""For the person who can mend it."""


@dataclass(frozen=True, slots=True, eq=False)
class ThrustCommand:
    """Thrusts for the next period."""

    thrusts: Array
    """(m,) [N], each 0 (off) to the robot's f_max."""
    armed: bool
    """Thrust is meant. False demands zeros, and lets the link begin a new epoch if it must."""
    stop: bool = False
    """Somebody pressed STOP: zero at once, even of a robot that ramps down by itself."""

    @classmethod
    def zero(cls, thrusters: int) -> ThrustCommand:
        """Zero thrust, disarmed."""
        return cls(np.zeros(thrusters), armed=False)


@dataclass(frozen=True, slots=True, eq=False)
class TwistCommand:
    """Set-point for the next period, of a robot that follows a velocity by itself."""

    twist_in_b: Array
    """(6,) velocity of the body's origin and its angular rate in f, in b [m/s, rad/s]."""
    armed: bool
    """Motion is meant. False demands zeros, as of thrusts."""
    stop: bool = False
    """Somebody pressed STOP: zero at once."""

    @classmethod
    def zero(cls) -> TwistCommand:
        """No motion, disarmed."""
        return cls(np.zeros(6), armed=False)


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeCommand:
    """Set-point for the next period, of a robot that keeps an attitude by itself."""

    attitude: Array
    """(4,) roll, pitch [rad], yaw rate [rad/s] and thrust along the body's z axis [N]; roll and
    pitch turn h, f's axes below the body's heading, into b: R_hb = R_y(pitch) R_x(roll)."""
    armed: bool
    """Thrust is meant. False demands zeros, as of thrusts."""
    stop: bool = False
    """Somebody pressed STOP: zero at once."""

    @classmethod
    def zero(cls) -> AttitudeCommand:
        """Level, no thrust, disarmed."""
        return cls(np.zeros(ATTITUDE_VALUES), armed=False)


RobotCommand = ThrustCommand | TwistCommand | AttitudeCommand
"""What robots are told; each takes one kind, which `[link] takes` of its file names."""


def zero_command(robot: Robot) -> RobotCommand:
    """Nothing, disarmed, of the kind that `robot` takes."""
    if robot.twist is not None:
        return TwistCommand.zero()
    if robot.attitude is not None:
        return AttitudeCommand.zero()
    return ThrustCommand.zero(robot.A.shape[1])


@dataclass(frozen=True, slots=True)
class BlinkOrder:
    """Which of its LEDs a robot keeps dark when: a round of slots, again and again for a while."""

    begin_us: int
    """On the robot's monotonic clock [µs]."""
    lasts_ms: int
    slot_ms: int
    dark: tuple[int, ...]
    """LED of each slot, or −1: none."""


@dataclass(frozen=True, slots=True, eq=False)
class BodySample:
    """One sample of the robot's body sensors, and what the robot says of itself."""

    t_us: int
    """Sampling time on the robot's own monotonic clock [µs]."""
    omega_in_b: Array
    """Gyroscope (3,) [rad/s], biased."""
    a_in_b: Array
    """Accelerometer (3,) [m/s²]: specific force, +9.8 up at rest, biased."""
    thrusts: Array
    """(m,) [N] that the robot has set its thrusters to; in simulation what they give."""
    state: FollowerState
    boot_id: int
    """Another one: the robot has restarted, and so has its clock."""
    refusal: Refusal
    """Why the state is RAMP or one of `STOPPED`; else why the newest command was not taken."""
    round_trip_s: float | None
    """From sending the newest accepted command to this sample's arrival [s]; None if unknown."""
    twist_in_b: Array | None = None
    """(6,) as the robot measures it [m/s, rad/s], of one that takes a twist: it has no thrusts."""
    twist_age_s: float | None = None
    """Of a robot without motion sensors, whose gyroscope and accelerometer say zeros here: how long
    before `t_us` that twist was measured [s]; `NOT_MEASURED`: it is what the robot was told. None:
    it has motion sensors."""


class Follower(Protocol):
    """Interface to one robot. Used from one thread; no method waits for the robot."""

    thrusters: int
    """m; 0 of a robot that takes a twist."""

    @property
    def epoch(self) -> int:
        """Number of the run of commands that the robot follows; shown to supervisors."""

    @property
    def dropped(self) -> int:
        """Messages that were not the robot's, damaged, repeated or late, since the start."""

    def receive(self) -> list[BodySample]:
        """Return all samples that have arrived since the last call, oldest first.

        Raises:
            FollowerError: closed. A lost link is no error: samples stay away.
        """

    def send(self, command: RobotCommand) -> None:
        """Send `command`, which was made of what `receive` last gave.

        Raises:
            FollowerError: of a kind that it does not take, wrong shape, not finite, outside the
                limits, not zero while not armed, or closed. Nothing was sent. A lost link is no
                error.
        """

    def stop(self) -> None:
        """Command zero at once, several times; never raises for a lost link."""

    def close(self) -> None:
        """Give the link back, without a word: a robot that gives thrust comes down by itself.

        May be called twice.
        """


def check_command(command: RobotCommand, thrusters: int, f_max: float) -> None:
    """Refuse what no robot with thrusters may be told.

    Raises:
        FollowerError: says what is allowed.
    """
    if not isinstance(command, ThrustCommand):
        raise FollowerError(_said(command), f"{thrusters} thrusts: this robot takes nothing else")
    thrusts = command.thrusts
    if thrusts.shape != (thrusters,):
        raise FollowerError(f"thrusts of shape {thrusts.shape}", f"({thrusters},)")
    if not bool(np.isfinite(thrusts).all()):
        raise FollowerError(f"thrusts {thrusts}", "finite numbers")
    if bool((thrusts < 0.0).any() or (thrusts > f_max).any()):
        raise FollowerError(f"thrusts {thrusts} N", f"0 to {f_max:g} N each")
    if (command.stop or not command.armed) and bool(thrusts.any()):
        raise FollowerError(f"thrusts {thrusts} N with `stop` or without `armed`", "zeros")


def check_twist(command: RobotCommand, drive: TwistDrive) -> None:
    """Refuse what no robot that takes a twist may be told.

    Raises:
        FollowerError: says what is allowed.
    """
    if not isinstance(command, TwistCommand):
        raise FollowerError(_said(command), "a twist: this robot takes nothing else")
    twist_in_b = command.twist_in_b
    if twist_in_b.shape != (6,):
        raise FollowerError(f"twist of shape {twist_in_b.shape}", "(6,)")
    if not bool(np.isfinite(twist_in_b).all()):
        raise FollowerError(f"twist {twist_in_b}", "finite numbers")
    if drive.exceeds(twist_in_b, ROUNDING):
        allowed = f"no more than {drive.speed:g} m/s and {drive.rate:.3g} rad/s"
        raise FollowerError(f"twist {twist_in_b}", allowed)
    if (command.stop or not command.armed) and bool(twist_in_b.any()):
        raise FollowerError(f"twist {twist_in_b} with `stop` or without `armed`", "zeros")


def check_attitude(command: RobotCommand, drive: AttitudeDrive, most: float) -> None:
    """Refuse what no robot that takes attitude and thrust, of `most` [N], may be told.

    Raises:
        FollowerError: says what is allowed.
    """
    if not isinstance(command, AttitudeCommand):
        raise FollowerError(_said(command), "attitude and thrust: this robot takes nothing else")
    told = command.attitude
    if told.shape != (ATTITUDE_VALUES,):
        raise FollowerError(f"attitude of shape {told.shape}", f"({ATTITUDE_VALUES},)")
    if not bool(np.isfinite(told).all()):
        raise FollowerError(f"attitude {told}", "finite numbers")
    roll, pitch, yaw_rate, thrust = told.tolist()
    if drive.exceeds(roll, pitch, yaw_rate, ROUNDING):
        allowed = f"no more than {drive.max_tilt:.3g} rad and {drive.yaw_rate:.3g} rad/s"
        raise FollowerError(f"attitude {told}", allowed)
    if not 0.0 <= thrust <= most * ROUNDING:
        raise FollowerError(f"thrust {thrust:g} N", f"0 to {most:g} N")
    if (command.stop or not command.armed) and bool(told.any()):
        raise FollowerError(f"attitude {told} with `stop` or without `armed`", "zeros")


def _said(command: RobotCommand) -> str:
    match command:
        case ThrustCommand():
            return "thrusts"
        case TwistCommand():
            return "a twist"
    return "attitude and thrust"


@runtime_checkable
class Blinking(Protocol):
    """A `Follower` whose robot can be told to blink."""

    def blink(self, order: BlinkOrder) -> None:
        """Send `order`; it may be lost."""


@runtime_checkable
class HasTool(Protocol):
    """A `Follower` whose robot may have a tool that opens and closes."""

    def use_tool(self, opening: float) -> None:
        """Send how far it shall be open, 0 to 1; to be said again every 20 ms, or it stays."""


@runtime_checkable
class TakesVision(Protocol):
    """A `Follower` whose robot may want to be told where it was seen."""

    wants_vision: bool
    """By its file."""

    def see(self, seen: StandingPose) -> None:
        """Send where a picture showed the body, in a frame that stands; it may be lost."""


@dataclass(frozen=True, slots=True)
class RobotHealth:
    """What a robot tells of itself beside its samples."""

    battery_v: float | None = None
    """Voltage of its battery [V]; None: it has none, or does not know."""
    e_stop: EStop = EStop.NOT_WIRED


@runtime_checkable
class TellsHealth(Protocol):
    """A `Follower` whose robot may tell how it is."""

    @property
    def health(self) -> tuple[RobotHealth, float] | None:
        """What this start of the robot told last, and when that came [s]; None: nothing yet."""
