"""The control process's end of the link, sans-I/O: epochs, counters, nonces, challenges.

A sample is believed if it was made with the robot's key and is newer than the last one of the same
start of the robot. The first one, and the first of another start, must echo a challenge of one of
our newest commands: so a recording of an earlier session or start is not believed, however many of
them somebody sends. Within a start the robot's own counter is enough.

What the robot tells of itself (`health_datagram.py`) is believed of the start whose samples are, if
its own counter is newer and its time no more than `HEALTH_LATE_US` before the newest sample's: a
recording of before this control process is older than that.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable

import numpy as np

from hardware.follower import (
    LIFT,
    STOPPED,
    AttitudeCommand,
    BlinkOrder,
    BodySample,
    RobotCommand,
    RobotHealth,
    ThrustCommand,
    TwistCommand,
    check_attitude,
    check_command,
    check_twist,
)
from hardware.link.blink_datagram import BlinkDatagram, encode_blink
from hardware.link.datagram import (
    U32,
    U64,
    CommandDatagram,
    LinkError,
    SampleDatagram,
    decode_sample,
    encode_command,
    is_later,
)
from hardware.link.health_datagram import MAGIC as HEALTH_MAGIC
from hardware.link.health_datagram import HealthDatagram, decode_health
from hardware.link.tool_datagram import ToolDatagram, encode_tool
from hardware.robot_file import RobotFile
from pipeline.config import PERIOD_S
from pipeline.frames import Array
from pipeline.robot import AttitudeDrive, TwistDrive

SENT_KEPT = 256
"""Commands remembered: 1.3 s."""
HEALTH_LATE_US = 500_000
"""What a link held back for longer is no news of a battery any more."""


def random_u64() -> int:
    """Unpredictable number of 64 bits, not 0."""
    return 1 + secrets.randbelow(U64 - 1)


class ControlEnd:
    """Turns commands into datagrams and datagrams into samples. Times are [s], monotonic."""

    def __init__(
        self,
        thrusters: int,
        f_max: float,
        max_rise: float,
        epoch: int,
        key: bytes,
        challenges: Callable[[], int] = random_u64,
        twist: TwistDrive | None = None,
        *,
        tells_motion: bool = False,
        attitude: AttitudeDrive | None = None,
    ) -> None:
        """Begin with a robot: thrusters give up to `f_max`, rise by `max_rise` per command [N].

        One that takes a `twist` has no thrusters, and one that `tells_motion` no motion sensors; of
        one that takes an `attitude` all its thrusters together rise so. `epoch` must be later than
        that of every control process the robot has followed.
        """
        self.thrusters, self.epoch = thrusters, epoch
        self._f_max, self._max_rise = f_max, max_rise
        self._key, self._new_challenge = key, challenges
        self._counter = 0
        self._twist, self._attitude, self._tells_motion = twist, attitude, tells_motion
        self._last = self._zero()
        self._sent_at = [0.0] * SENT_KEPT
        self._challenges = [0] * SENT_KEPT
        self._newest: SampleDatagram | None = None
        self.limited = 0
        """Commands that rose or changed faster than the robot allows and were slowed down."""
        self.dropped = 0
        """Datagrams that were not the robot's, repeated, overtaken or of an earlier session."""
        self._health_counter: int | None = None
        """Of the newest health believed of the robot's present start."""
        self.health: tuple[RobotHealth, float] | None = None
        """See `TellsHealth`."""

    @classmethod
    def of(
        cls,
        robot_file: RobotFile,
        key: bytes,
        epoch: int,
        challenges: Callable[[], int] = random_u64,
    ) -> ControlEnd:
        """Control end for the robot of a robot file."""
        robot = robot_file.robot
        return cls(
            robot.A.shape[1],
            robot.f_max,
            robot_file.link.max_rise,
            epoch,
            key,
            challenges,
            robot.twist,
            tells_motion=robot.motion is not None,
            attitude=robot.attitude,
        )

    def command(self, command: RobotCommand, now: float) -> bytes:
        """The datagram for `command`.

        It echoes the newest sample its sender can have known: a late command can't seem fresh.

        Raises:
            FollowerError: a command no robot may be told.
        """
        return encode_command(self.next_command(command, now), self._key)

    def next_command(self, command: RobotCommand, now: float) -> CommandDatagram:
        """The same, for a link that writes it in bytes of its own.

        Raises:
            FollowerError: a command no robot may be told.
        """
        self._check(command)
        if not command.armed and self._newest and self._is_outdated(self._newest):
            self._renew(self._newest)
        self._counter = (self._counter + 1) % U32
        self._last = self._slowed(command)
        values = tuple(self._last.tolist())
        challenge = self._new_challenge()
        self._sent_at[self._counter % SENT_KEPT] = now
        self._challenges[self._counter % SENT_KEPT] = challenge
        return CommandDatagram(
            epoch=self.epoch,
            counter=self._counter,
            nonce=self._newest.nonce if self._newest else 0,
            challenge=challenge,
            armed=command.armed,
            thrusts=values if isinstance(command, ThrustCommand) else (),
            stop=command.stop,
            twist_in_b=values if isinstance(command, TwistCommand) else (),
            attitude=values if isinstance(command, AttitudeCommand) else (),
        )

    def zero(self) -> RobotCommand:
        """Nothing, disarmed, of the kind that the robot takes."""
        if self._twist is not None:
            return TwistCommand.zero()
        if self._attitude is not None:
            return AttitudeCommand.zero()
        return ThrustCommand.zero(self.thrusters)

    def blink(self, order: BlinkOrder) -> bytes:
        """The datagram for `order`; it is no command, and counts as none."""
        nonce = self._newest.nonce if self._newest else 0
        return encode_blink(BlinkDatagram(self.epoch, nonce, order), self._key)

    def tool(self, opening: float) -> bytes:
        """The datagram for a tool that shall be open so far, 0 to 1; it is no command, either."""
        nonce = self._newest.nonce if self._newest else 0
        return encode_tool(ToolDatagram(self.epoch, nonce, opening), self._key)

    def receive(self, data: bytes, now: float) -> BodySample | None:
        """The sample in `data`; None and counted if it is none, or not to be believed.

        None, too, of what the robot tells of itself: that is then `health`.
        """
        if data[: len(HEALTH_MAGIC)] == HEALTH_MAGIC:
            self._hear_health(data, now)
            return None
        try:
            sample = decode_sample(data, self._key)
        except LinkError:
            self.dropped += 1
            return None
        return self.believe(sample, now)

    def believe(self, sample: SampleDatagram, now: float) -> BodySample | None:
        """The same of what a link has read in bytes of its own."""
        ours = len(sample.thrusts) == self.thrusters and bool(sample.twist_in_b) == bool(
            self._twist
        )
        ours = ours and (sample.twist_age_s is not None) == self._tells_motion
        if not ours or not self._is_believed(sample):
            self.dropped += 1
            return None
        if self._newest is not None and sample.boot_id != self._newest.boot_id:
            self.health = self._health_counter = None
        self._newest = sample
        return BodySample(
            t_us=sample.t_us,
            omega_in_b=np.array(sample.omega_in_b),
            a_in_b=np.array(sample.a_in_b),
            thrusts=np.array(sample.thrusts),
            state=sample.state,
            boot_id=sample.boot_id,
            refusal=sample.refusal,
            round_trip_s=self._round_trip(sample, now),
            twist_in_b=np.array(sample.twist_in_b) if sample.twist_in_b else None,
            twist_age_s=sample.twist_age_s,
        )

    def _is_believed(self, sample: SampleDatagram) -> bool:
        last = self._newest
        if last is not None and sample.boot_id == last.boot_id:
            return is_later(sample.counter, last.counter)
        return sample.challenge != 0 and sample.challenge in self._challenges

    def _hear_health(self, data: bytes, now: float) -> None:
        try:
            said = decode_health(data, self._key)
        except LinkError:
            self.dropped += 1
            return
        if self._is_health_believed(said):
            self._health_counter, self.health = said.counter, (said.health, now)
        else:
            self.dropped += 1

    def _is_health_believed(self, said: HealthDatagram) -> bool:
        robot, last = self._newest, self._health_counter
        if robot is None or said.boot_id != robot.boot_id:
            return False
        newer = last is None or is_later(said.counter, last)
        return newer and robot.t_us - said.t_us <= HEALTH_LATE_US

    def _is_outdated(self, robot: SampleDatagram) -> bool:
        """Whether the robot would never again take our epoch."""
        refusing = robot.state in STOPPED and robot.epoch != 0
        return refusing and self.epoch <= robot.epoch < U64 - 1  # nothing is later than that

    def _renew(self, robot: SampleDatagram) -> None:
        self.epoch = robot.epoch + 1
        self._counter = 0
        self._last = self._zero()

    def _zero(self) -> Array:
        return _values(self.zero())

    def _check(self, command: RobotCommand) -> None:
        if self._twist is not None:
            check_twist(command, self._twist)
        elif self._attitude is not None:
            check_attitude(command, self._attitude, self.thrusters * self._f_max)
        else:
            check_command(command, self.thrusters, self._f_max)

    def _slowed(self, command: RobotCommand) -> Array:
        """What is commanded, no faster than the robot takes: late is better than refused."""
        wanted = slowed = _values(command)
        if self._twist is None:
            rises = slice(None) if self._attitude is None else LIFT
            slowed = wanted.copy()
            slowed[rises] = np.minimum(wanted[rises], self._last[rises] + self._max_rise)
        elif wanted.any():  # zero is never late
            slowed = self._twist.toward(self._last, wanted, PERIOD_S)
        self.limited += int(bool((slowed != wanted).any()))
        return slowed

    def _round_trip(self, sample: SampleDatagram, now: float) -> float | None:
        behind = (self._counter - sample.accepted) % U32
        if sample.epoch != self.epoch or behind >= SENT_KEPT or sample.accepted == 0:
            return None
        return now - self._sent_at[sample.accepted % SENT_KEPT]


def _values(command: RobotCommand) -> Array:
    """What is commanded, of whatever kind."""
    match command:
        case ThrustCommand():
            return command.thrusts
        case TwistCommand():
            return command.twist_in_b
    return command.attitude
