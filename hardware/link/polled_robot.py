"""The robot's end of the link for a program that asks for its set-point at a pace of its own.

`robot_end.py` gates, watches and brakes at 200 Hz, in a thread (`polled_server.py`); the program
asks thirty times a second, late, or never again. Between them go immutable values, the newest wins:

| who is silent                        | what happens                                             |
|--------------------------------------|----------------------------------------------------------|
| control, or the way to it            | not enabled after 60 ms, zero after 0.17 s (`robot_end`) |
| our thread: another one has Python   | the same, by the clock of who asks                       |
| who asks                             | after `UNASKED_US` the end refuses and tells so: control |
|                                      | ramps down and disarms, and must be armed anew           |

The last one stops no robot: it goes on by what it was told last, as its own controller will.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hardware.follower import NOT_MEASURED, FollowerState, Refusal
from hardware.link.robot_end import SILENCE_US, LinkLimits, Peer, RobotEnd
from hardware.link.tool_end import ToolEnd
from hardware.robot_file import RobotFile, RobotFileError
from hardware.twist_schema import TOLD_ZERO_S
from pipeline.frames import Array, Triple

UNASKED_US = 250_000
"""A loop of 10 Hz may miss its turn twice."""
TOLD_ZERO_US = round(1e6 * TOLD_ZERO_S)
OLDEST_S = 10.0
"""Age that is told of anything older, and before anything was taken."""
NO_SENSORS: Triple = (0.0, 0.0, 0.0)
"""What gyroscope and accelerometer say that there are not."""
TAKES = "it has thrusters; allowed is 'twist': nobody asks for thrusts thirty times a second"
COMMANDED = "allowed is [motion] with twist = 'commanded': who asks tells nothing of how it moves"


@dataclass(frozen=True, slots=True, eq=False)
class PolledTwist:
    """What the robot is to do now."""

    twist_in_b: Array
    """(6,) velocity of the body's origin and angular rate in f, in b [m/s, rad/s]."""
    enabled: bool
    """Somebody leads, and what he said is fresh; False while it brakes, too."""
    age_s: float
    """Since the last command taken [s], at most `OLDEST_S`."""
    opening: float | None = None
    """How far its tool shall be open, 0 to 1; None: it stays as it is."""


@dataclass(frozen=True, slots=True, eq=False)
class _Tick:
    """What the end made of its newest tick."""

    at_us: int
    taken_us: int | None
    running: bool
    twist_in_b: Array
    opening: float | None = None


class PolledRobot:
    """Ticks at 200 Hz in one thread, is asked in another; times are [µs] of one monotonic clock."""

    def __init__(
        self, robot_file: RobotFile, boot_id: int, nonces: Callable[[], int], key: bytes
    ) -> None:
        """Refusing, until it is asked and control has begun with zero.

        Raises:
            RobotFileError: of a robot that has thrusters, or whose motion somebody must measure.
        """
        robot = robot_file.robot
        if robot.twist is None:
            raise RobotFileError(robot.name, "link.takes", TAKES)
        if robot.motion is None or robot_file.plant.odometry is not None:
            raise RobotFileError(robot.name, "motion.twist", COMMANDED)
        self.end = RobotEnd(LinkLimits.of(robot_file), boot_id, key)
        self._tool = ToolEnd(key) if robot.tool else None
        self._nonces = nonces
        self._taken_us: int | None = None
        self._tick = _Tick(0, None, running=False, twist_in_b=np.zeros(6))
        self._asked: tuple[int | None, Array] = None, np.zeros(6)
        """When it was asked last, and what it answered."""

    def receive(self, data: bytes, peer: Peer, now_us: int) -> None:
        """A datagram has come from `peer`."""
        if self._tool is not None and self._tool.receive(data, self.end, now_us):
            return
        if self.end.receive(data, peer, now_us) == Refusal.NONE:
            self._taken_us = now_us

    def tick(self, now_us: int) -> tuple[bytes, ...]:
        """Move on to `now_us`; gives the sample for `end.recipients`: what the robot was told."""
        asked_us, told_in_b = self._asked
        if asked_us is None or now_us - asked_us > UNASKED_US:
            self.end.halt()
        twist_in_b = self.end.setpoint(now_us)
        running = self.end.state == FollowerState.RUNNING
        opening = None if self._tool is None else self._tool.wanted(self.end, now_us)
        self._tick = _Tick(now_us, self._taken_us, running, twist_in_b, opening)
        return (self._sample(now_us, told_in_b),)

    def ask(self, now_us: int) -> PolledTwist:
        """What the robot is to do now. From whichever thread."""
        tick = self._tick
        late_us = now_us - tick.at_us
        twist_in_b = tick.twist_in_b if late_us <= TOLD_ZERO_US else np.zeros(6)
        self._asked = now_us, twist_in_b
        age_s = OLDEST_S if tick.taken_us is None else 1e-6 * (now_us - tick.taken_us)
        is_fresh = late_us <= SILENCE_US
        enabled, opening = tick.running and is_fresh, tick.opening if is_fresh else None
        return PolledTwist(twist_in_b, enabled, min(max(age_s, 0.0), OLDEST_S), opening)

    def shut_down(self, now_us: int) -> bytes:
        """Refuse for good; gives the last sample, which says so."""
        self.end.halt()
        return self._sample(now_us, np.zeros(6))

    def _sample(self, now_us: int, told_in_b: Array) -> bytes:
        nonce = self._nonces()
        return self.end.sample(now_us, nonce, NO_SENSORS, NO_SENSORS, told_in_b, NOT_MEASURED)
