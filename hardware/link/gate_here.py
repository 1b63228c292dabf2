"""The gate and the watchdog of our own link, in control's process, for a robot that has neither.

What control says goes as a command of our own link to the end that a robot of ours would have
(`robot_end.py`), what the robot says comes from there as one of its samples; what that end gives is
what the robot is told. So each rule of our own link holds, with one exception: when this process
dies nobody is told anything, and the robot has to stop by itself.
"""

from __future__ import annotations

import secrets

from hardware.follower import BodySample, Refusal, RobotCommand
from hardware.link.control_end import ControlEnd, random_u64
from hardware.link.link_key import new_key
from hardware.link.robot_end import LinkLimits, RobotEnd
from hardware.robot_file import RobotFile
from pipeline.frames import Array, Triple

HERE = ("here", 0)
NOTHING: Triple = (0.0, 0.0, 0.0)
"""By motion sensors that a robot has not."""


class GateHere:
    """Both ends of a link, and nothing between them. Times are [s], monotonic."""

    def __init__(self, robot_file: RobotFile, epoch: int) -> None:
        """Refusing, until control has begun with zero."""
        self._limits, self._key = LinkLimits.of(robot_file), new_key()
        self._control = ControlEnd.of(robot_file, self._key, epoch)
        self._boot_id = secrets.randbits(31)
        self.begin()

    @property
    def epoch(self) -> int:
        """Under which commands are given; a new one after the gate has gone to zero by itself."""
        return self._control.epoch

    @property
    def dropped(self) -> int:
        """Samples that control's end did not believe."""
        return self._control.dropped

    @property
    def boot_id(self) -> int:
        """Another one with each start of the robot."""
        return self._boot_id

    def begin(self) -> None:
        """With a robot that has just started, for all we know."""
        self._boot_id += 1
        self._end = RobotEnd(self._limits, self._boot_id, self._key)

    def command(self, command: RobotCommand, now: float) -> Array:
        """What the robot is to be told, of whatever kind it takes: see `RobotEnd.setpoint`.

        Raises:
            FollowerError: a command no robot may be told.
        """
        self._end.receive(self._control.command(command, now), HERE, _us(now))
        return self.setpoint(now)

    def setpoint(self, now: float) -> Array:
        """The same, without another command."""
        return self._end.setpoint(_us(now))

    def zero(self) -> RobotCommand:
        """Nothing, disarmed."""
        return self._control.zero()

    def halt(self, why: Refusal) -> None:
        """The robot has stopped by itself: zero at once, then refuse."""
        self._end.halt(why)

    def wire(self, *, is_open: bool) -> None:
        """What the robot's emergency stop says; to be told before each `setpoint`, if it exists."""
        self._end.wire(is_open=is_open)

    def sample(
        self,
        dated: float,
        moves: Array,
        now: float,
        *,
        twist_age_s: float | None = None,
        omega_in_b: Triple = NOTHING,
        a_in_b: Triple = NOTHING,
    ) -> BodySample | None:
        """The sample of a robot that `moves` by a twist (6,) in b, or gives thrusts (m,) [N].

        None: not to be believed.
        """
        data = self._end.sample(_us(dated), random_u64(), omega_in_b, a_in_b, moves, twist_age_s)
        return self._control.receive(data, now)


def _us(t: float) -> int:
    return round(1e6 * t)
