"""An arm of Franka's without its library: what is believed of it, and what it is told.

The arm has a watchdog, but none that knows epochs or answers, so the gate of our own link stands
here (`link/gate_here.py`). Control has its sample, by which it may command, only while the arm has
said something within `SILENT_S`.

* An arm that its own controller has stopped, by a reflex, or that somebody guides by hand, is told
  nothing but zero and refuses, with the reason. While control is disarmed, and no sooner, it is
  asked to recover from its errors; then it needs zero of a new epoch, and somebody who arms.
* Its emergency stop is that of our own link (rule 6 of `robot_end.py`).
* An arm that was connected to anew has just started, for all we know.

A twist is of the body b, which the end effector e carries; the arm takes and tells that of e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hardware.follower import BodySample, EStop, Refusal, RobotCommand, RobotHealth
from hardware.link.gate_here import GateHere
from hardware.link.stamp_clock import StampClock
from hardware.robot_file import FrankaParameters, RobotFile
from pipeline.frames import Array, skew
from pipeline.robot import TwistDrive

SILENT_S = 0.04
"""Of an arm that says something every millisecond, on a computer that does several things."""


@dataclass(frozen=True, slots=True, eq=False)
class HeardArm:
    """What the arm says of itself at one time."""

    connection: int
    """Another one: it was connected to anew, and its clock may be another."""
    stamp: float
    """On the arm's clock [s]."""
    at: float
    """When it came, on ours [s, monotonic]."""
    R_oe: Array
    """(3, 3) attitude of the end effector e in the axes o of the arm's base."""
    twist_in_e: Array
    """(6,) of e's origin, by its joints [m/s, rad/s] ..."""
    before_s: float = 0.0
    """... so long before `stamp`, for it is the mean of twice that."""
    fault: str = ""
    """Why it does not move; "": it can."""
    is_stopped: bool = False
    """Its emergency stop is pressed."""


@dataclass(frozen=True, slots=True, eq=False)
class ToldArm:
    """What the arm is to do."""

    at: float
    """When that was said [s, monotonic]."""
    twist_in_o: Array
    """(6,) of the end effector's origin, in the axes of the arm's base [m/s, rad/s]."""
    recovers: bool
    """From its errors: nobody may move it now."""


@dataclass(frozen=True, slots=True)
class ArmLimits:
    """Of the end effector's origin, when the body does all that its drive allows at once."""

    speed: float
    acceleration: float
    rate: float
    angular_acceleration: float

    @classmethod
    def of(cls, drive: TwistDrive, mount: FrankaParameters) -> ArmLimits:
        """Limits of an arm that carries the body so."""
        lever = float(np.linalg.norm(mount.p_be_in_e))
        return cls(
            drive.speed + lever * drive.rate,
            drive.acceleration + lever * drive.angular_acceleration,
            drive.rate,
            drive.angular_acceleration,
        )


class ArmEnd:
    """Turns commands into twists of the end effector, and what it says into samples. Times: [s]."""

    def __init__(self, robot_file: RobotFile, mount: FrankaParameters, epoch: int) -> None:
        """Nothing said, nothing heard."""
        self._gate, self._clock = GateHere(robot_file, epoch), StampClock()
        self._to_body = _carried(mount)
        self._to_end_effector = np.linalg.inv(self._to_body)
        self._heard: HeardArm | None = None
        self._twist_in_b, self._measured_at = np.zeros(6), -np.inf
        self._dropped = 0

    @property
    def epoch(self) -> int:
        """Under which commands are given; a new one after the gate has gone to zero by itself."""
        return self._gate.epoch

    @property
    def dropped(self) -> int:
        """What was repeated, overtaken or no number."""
        return self._dropped + self._gate.dropped

    @property
    def health(self) -> tuple[RobotHealth, float] | None:
        """See `TellsHealth`."""
        if self._heard is None:
            return None
        e_stop = EStop.OPEN if self._heard.is_stopped else EStop.CLOSED
        return RobotHealth(e_stop=e_stop), self._heard.at

    def zero(self) -> RobotCommand:
        """Nothing, disarmed."""
        return self._gate.zero()

    def command(self, command: RobotCommand, now: float) -> ToldArm:
        """What the arm is to be told.

        Raises:
            FollowerError: a command no robot may be told.
        """
        twist_in_b = self._gate.command(command, now)
        heard = self._heard
        if heard is None:
            return ToldArm(now, np.zeros(6), recovers=False)
        twist_in_e = self._to_end_effector @ twist_in_b
        twist_in_o = np.concatenate((heard.R_oe @ twist_in_e[:3], heard.R_oe @ twist_in_e[3:]))
        return ToldArm(now, twist_in_o, recovers=bool(heard.fault) and not command.armed)

    def hear(self, heard: HeardArm) -> None:
        """The arm has said that."""
        if self._heard is not None and heard.connection != self._heard.connection:
            self._gate.begin()
            self._clock = StampClock()
        can_be = bool(np.isfinite(heard.twist_in_e).all() and np.isfinite(heard.R_oe).all())
        dated = self._clock.dated(heard.stamp, heard.at) if can_be else None
        if dated is None:
            self._dropped += 1
            return
        self._heard, self._measured_at = heard, dated - heard.before_s
        self._twist_in_b = self._to_body @ heard.twist_in_e

    def beat(self, now: float) -> BodySample | None:
        """A sample of it, whenever control asks; None while the arm is silent."""
        heard = self._heard
        if heard is None or now - heard.at > SILENT_S:
            return None
        self._gate.wire(is_open=heard.is_stopped)
        if heard.fault:
            self._gate.halt(Refusal.FAULT)
        age_s = max(0.0, now - self._measured_at)
        return self._gate.sample(now, self._twist_in_b, now, twist_age_s=age_s)


def _carried(mount: FrankaParameters) -> Array:
    """(6, 6) from a twist of the end effector in e to that of the body in b."""
    R_be = mount.R_be
    return np.block([[R_be, -R_be @ skew(mount.p_be_in_e)], [np.zeros((3, 3)), R_be]])
