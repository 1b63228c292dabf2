"""A robot without motion sensors as one that has some: samples by what it told of its twist.

Each of its samples becomes one of the body at the same time, so that all who watch for silence,
gaps and clocks do as they do: its twist as measured and as presumed since, its turn's rate, and, of
one that stands level, what an accelerometer on it would feel. Of another one nobody says which way
is up: its specific force is zeros, which no accelerometer measures, and who needs one has none.
"""

from __future__ import annotations

from math import inf

import numpy as np

from hardware.follower import BodySample, FollowerState, RobotCommand, TwistCommand
from hardware.presumed_twist import PresumedTwist
from pipeline.frames import GRAVITY, UP, cross
from pipeline.robot import Robot, ToldMotion, TwistDrive
from pipeline.signals import BodyImu

UNTOLD = "The robot does not say for the moment how it moves."
AT_REST_IN_B = GRAVITY * UP
APART_S = 1e-3
"""Two twists are measured farther apart: else it is the same, on a clock that is adjusted."""


class ToldBody:
    """Times are [s], of our clock."""

    def __init__(self, drive: TwistDrive, motion: ToldMotion) -> None:
        """At rest."""
        self._presumed, self._motion = PresumedTwist(drive), motion
        self._commanded = np.zeros(6)
        self._t_measured = -inf

    @classmethod
    def of(cls, robot: Robot) -> ToldBody | None:
        """For a robot; None: it has motion sensors."""
        if robot.twist is None or robot.motion is None:
            return None
        return cls(robot.twist, robot.motion)

    def tell(self, command: RobotCommand) -> None:
        """The robot is told `command`, which it follows if it follows at all."""
        if isinstance(command, TwistCommand):
            self._commanded = command.twist_in_b

    def hear(self, sample: BodySample, t: float) -> BodyImu | None:
        """The body at `t`, by the robot's sample of that time; None: it does not tell."""
        obeys = sample.state == FollowerState.RUNNING
        self._presumed.tell(self._commanded if obeys else np.zeros(6), t)
        if self._motion.is_measured and not self._measured(sample, t):
            return None
        twist = self._presumed.at(t)
        v, omega, force = twist[:3], twist[3:], np.zeros(3)
        if self._motion.is_level:
            force = AT_REST_IN_B + self._presumed.rate[:3] + cross(omega, v)
        return BodyImu(t, omega, force, twist)

    def _measured(self, sample: BodySample, t: float) -> bool:
        """Whether it says lately how it moves."""
        twist, age_s = sample.twist_in_b, sample.twist_age_s
        if twist is None or age_s is None or not 0.0 <= age_s <= self._motion.lasts_s:
            return False
        t_measured = t - age_s
        if t_measured > self._t_measured + APART_S:
            self._presumed.measured(twist, t_measured)
            self._t_measured = t_measured
        return True
