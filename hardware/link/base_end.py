"""A base without key or gate, and without a socket: who it is, what is believed, what it is told.

Bases of ROS 2 and autopilots of MAVLink are such: nobody can be told apart by what they speak, and
no message answers another. So the gate and the watchdog that our own link has on the robot
stand here (`gate_here.py`), in control's process, before the first byte. Whatever control says goes
through them, and what they give is what the base is told:

* The gate takes a command only if control has just had a sample of the base's motion sensors, or,
  of a base that has none, its odometry is as fresh as its file says it comes. A base that isn't
  heard any more is told to stand still, from 60 ms on, within its accelerations,
  and goes on being told zero. So is one whose samples arrive 40 ms later than the quickest ones.
* A new control process, and a base whose driver has restarted, begins with half a second of zero.
* The first who publishes samples that can be is the base, until he has been silent for a second;
  what others publish is dropped. The same of odometry.

A base that says nothing at all (`twist = "commanded"`) is taken to be there while somebody listens
to what it is told; that its driver hangs nobody notices but the pictures.

What it can't do is stop a base when this process or its network dies: the base itself has to, so
that its robot file says who does (`stopped_by`). Nor does anybody answer: a round trip is from a
command that the gate took to the next sample of the base.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from hardware.follower import NOT_MEASURED, BodySample, Refusal, RobotCommand
from hardware.link.gate_here import GateHere
from hardware.link.stamp_clock import StampClock
from hardware.pose_setpoint import BasePose
from hardware.presumed_thrusts import PresumedThrusts
from hardware.presumed_twist import PresumedTwist
from hardware.robot_file import RobotFile
from pipeline.frames import Array, Triple, triple

KEEPS_WRITER_S = 1.0
"""So long nobody else is heard in place of one who has fallen silent."""
ODOMETRY_LASTS_S = 0.1
"""With an older one nothing is known of how the base moves, and its samples are not believed."""
MOST = 1e4
"""Nothing that a robot measures is more [rad/s, m/s², m/s]."""


@dataclass(frozen=True, slots=True)
class HeardImu:
    """A message of the base's motion sensors."""

    writer: Hashable
    """Whose."""
    stamp_us: int
    """On its own clock [µs], 0: not dated."""
    omega_in_i: Triple
    """[rad/s]."""
    a_in_i: Triple
    """Specific force [m/s²]."""
    measures_both: bool
    """Neither is missing."""
    at: float | None = None
    """When that was on our clock [s]; None: nobody has related the two."""


@dataclass(frozen=True, slots=True)
class HeardOdometry:
    """How a base moves, by its wheels, joints or whatever it has."""

    writer: Hashable
    twist_in_b: tuple[float, float, float, float, float, float]
    """[m/s, rad/s]."""
    stamp_us: int = 0
    """On its own clock [µs], 0: not dated."""
    at: float | None = None
    """As of `HeardImu`."""
    pose: BasePose | None = None
    """Where it is; None: it does not say, or nobody wants to know."""


@dataclass(frozen=True, slots=True)
class HeardJoints:
    """A message of an arm's joints, of which `ros2/joint_odometry.py` makes the other."""

    writer: Hashable
    """Whose."""
    stamp_us: int
    """On its own clock [µs], 0: not dated."""
    names: tuple[str, ...]
    positions: tuple[float, ...]
    """[rad]; it may have none."""
    velocities: tuple[float, ...]
    """[rad/s]; many have none."""


Writer = TypeVar("Writer", bound=Hashable)


class FirstWriter(Generic[Writer]):
    """Keeps to one of those who publish. Times are [s], monotonic."""

    def __init__(self) -> None:
        """Nobody yet."""
        self.writer: Writer | None = None
        self._heard = 0.0

    def admits(self, writer: Writer, now: float) -> bool:
        """Whether this one is, or now becomes, the one; of who said something that can be."""
        is_other = self.writer not in (None, writer)
        if is_other and now - self._heard <= KEEPS_WRITER_S:
            return False
        self.writer, self._heard = writer, now
        return True


class BaseEnd:
    """Turns commands into set-points, messages of a base into samples. Times are [s], monotonic."""

    def __init__(
        self,
        robot_file: RobotFile,
        epoch: int,
        R_bi: Array,
        *,
        has_odometry: bool,
        says_where: bool = False,
    ) -> None:
        """Nothing said, nothing heard.

        `R_bi` (3, 3) is from the axes of its motion sensors to the body's; `says_where`: odometry
        without a pose is none.
        """
        drive = robot_file.robot.twist
        self._presumed = PresumedTwist(drive) if drive else PresumedThrusts(robot_file.robot)
        self._gate, self._clock = GateHere(robot_file, epoch), StampClock()
        self._R_bi, self._has_odometry, self._says_where = R_bi, has_odometry, says_where
        self.pose: BasePose | None = None
        """Where it said last that it is."""
        self._imu_writer = FirstWriter[Hashable]()
        self._odometry_writer = FirstWriter[Hashable]()
        self._twist_in_b, self._twist_at = np.zeros(6), -np.inf
        self._motion, self._t_measured = robot_file.robot.motion, -np.inf
        self._dropped = 0
        self._held_by = Refusal.NONE

    @property
    def epoch(self) -> int:
        """Under which commands are given; a new one after the gate has gone to zero by itself."""
        return self._gate.epoch

    @property
    def boot_id(self) -> int:
        """Another one with each start of the base, for all we know."""
        return self._gate.boot_id

    @property
    def dropped(self) -> int:
        """Messages that were not the base's, not to be believed, repeated or overtaken."""
        return self._dropped + self._gate.dropped

    def drop(self) -> None:
        """Something came that could not be read."""
        self._dropped += 1

    def command(self, command: RobotCommand, now: float) -> Array:
        """What the base is to be told: a twist (6,) in b [m/s, rad/s], or attitude and thrust (4,).

        Raises:
            FollowerError: a command no robot may be told.
        """
        told = self._gate.command(command, now)
        self._presumed.tell(told, now)
        return told

    def hold(self, why: Refusal) -> None:
        """From now on it follows nobody; NONE: it does again, after half a second of zero."""
        self._held_by = why
        if why != Refusal.NONE:
            self._gate.halt(why)

    def zero(self) -> RobotCommand:
        """Nothing, disarmed."""
        return self._gate.zero()

    def hear(self, heard: HeardImu | HeardOdometry, now: float) -> BodySample | None:
        """The sample that comes of a message; None if none does."""
        if isinstance(heard, HeardImu):
            return self._hear_imu(heard, now)
        before = self._odometry_writer.writer
        can_be = _can_be(*heard.twist_in_b) and self._says_enough(heard.pose)
        if can_be and self._odometry_writer.admits(heard.writer, now):
            self._hear_odometry(heard, before not in (None, heard.writer), now)
        else:
            self._dropped += 1
        return None

    def beat(self, now: float) -> BodySample | None:
        """A sample of a base without motion sensors, whenever control asks; None: it has some.

        None, too, while its odometry is silent.
        """
        if self._motion is None:
            return None
        told, age_s = self._gate.setpoint(now), NOT_MEASURED
        if self._motion.is_measured:
            told, age_s = self._twist_in_b, now - self._t_measured
            if age_s > self._motion.lasts_s:
                return None
        return self._believed(self._gate.sample(now, told, now, twist_age_s=age_s))

    def _hear_odometry(self, heard: HeardOdometry, is_other: bool, now: float) -> None:
        stamp, at, dated = 1e-6 * heard.stamp_us, heard.at, now
        if self._motion is not None and heard.stamp_us > 0:
            if is_other or self._clock.is_set_anew(stamp, now):
                self._begin()
                at = None  # by the clock that it had
            on_ours = self._clock.dated(stamp, now)
            if on_ours is None:
                self._dropped += 1
                return
            dated = _earliest(on_ours, at, now)
        self._twist_in_b, self._twist_at, self.pose = np.array(heard.twist_in_b), now, heard.pose
        self._t_measured = dated

    def _hear_imu(self, heard: HeardImu, now: float) -> BodySample | None:
        before = self._imu_writer.writer
        can_be = heard.measures_both and heard.stamp_us > 0
        can_be = can_be and _can_be(*heard.omega_in_i, *heard.a_in_i)
        if not can_be or not self._imu_writer.admits(heard.writer, now):
            self._dropped += 1
            return None
        stamp, at = 1e-6 * heard.stamp_us, heard.at
        is_other = before not in (None, heard.writer)
        if is_other or self._clock.is_set_anew(stamp, now):
            self._begin()
            at = None  # by the clock that it had
        dated = self._clock.dated(stamp, now)
        if dated is None or not self._knows_its_twist(now):
            self._dropped += 1
            return None
        return self._sample(heard, _earliest(dated, at, now), now)

    def _says_enough(self, pose: BasePose | None) -> bool:
        if pose is None:
            return not self._says_where
        return _can_be(*pose.p_bk_in_k.tolist(), *pose.R_kb.ravel().tolist())

    def _begin(self) -> None:
        """With a base that has just started, for all we know."""
        self._gate.begin()
        self._clock = StampClock()

    def _knows_its_twist(self, now: float) -> bool:
        return not self._has_odometry or now - self._twist_at <= ODOMETRY_LASTS_S

    def _sample(self, heard: HeardImu, dated: float, now: float) -> BodySample | None:
        omega_in_b = self._R_bi @ np.array(heard.omega_in_i)
        a_in_b = self._R_bi @ np.array(heard.a_in_i)
        moves = self._twist_in_b if self._has_odometry else self._presumed.at(now)
        sample = self._gate.sample(
            dated, moves, now, omega_in_b=triple(omega_in_b), a_in_b=triple(a_in_b)
        )
        sample = self._believed(sample)
        return None if sample is None else replace(sample, t_us=heard.stamp_us)

    def _believed(self, sample: BodySample | None) -> BodySample | None:
        if sample is None or self._held_by == Refusal.NONE:
            return sample
        return replace(sample, refusal=self._held_by)


def _earliest(quickest: float, at: float | None, now: float) -> float:
    """When a stamp was: no message took less than no time, none came before our clock began."""
    return max(0.0, min(quickest, now, quickest if at is None else at))


def _can_be(*values: float) -> bool:
    """Whether they are numbers, and no larger than anything that is measured."""
    return all(abs(value) < MOST for value in values)
