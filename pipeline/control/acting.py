"""What moves a robot, behind one interface: by its thrusts, or by a set-point that it takes.

`Teleop` decides where the robot shall be and whether to fly at all; who stands behind `Acting`
decides what the robot is told for that. `thrust_acting.py` and `twist_acting.py` are the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from pipeline.control.leading import Leading
from pipeline.control.leash import Leashed
from pipeline.control.pid import PoseError, Reference
from pipeline.control.tracking import Situation
from pipeline.frames import Array
from pipeline.signals import BodyImu, Mode, VirtualView


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What a period is about."""

    mode: Mode
    reference: Reference | None
    """Where the robot shall be now."""
    leading: Leading
    body: BodyImu
    """The robot's newest sample."""
    is_deaf: bool
    """The robot's turns since the last period are unknown."""
    h: float
    """Since the last period [s]."""
    silence_s: float
    """Age of the oldest news of operator, phone and robot [s]."""
    knows_vertical: bool
    """Phone and pictures say where down is; else the robot's gyroscope alone, which drifts."""


@dataclass(frozen=True, slots=True, eq=False)
class Acted:
    """What the robot is told."""

    thrusts: Array
    """(m,) [N]; none of a robot that takes a twist. Of one that takes attitude and thrust: what
    its thrusters should then give, level or not."""
    saturated: bool
    """It can't do all that is wanted."""
    twist_in_b: Array | None = None
    """(6,) velocity and angular rate of the body, in b [m/s, rad/s], of a robot that takes it."""
    attitude: Array | None = None
    """(4,) roll, pitch [rad], yaw rate [rad/s] and thrust [N] of a robot that takes them."""


class Acting(Protocol):
    """One robot's, called once a period in this order: `watch`, `observe`, ..., `act`."""

    @property
    def weak_thrusters(self) -> tuple[str, ...]:
        """Those that don't give what they are told, in words."""

    @property
    def fault(self) -> str:
        """Why the robot can't be flown on; empty if it can."""

    @property
    def is_pushed(self) -> bool:
        """Something that neither thrusters nor suspension explain pushes it."""

    def push(self, wrench_in_b: Array) -> None:
        """From now on the thrusters also give this (6,) [N, N m]: a disturbance."""

    def watch(self, obeyed: bool, body: BodyImu, h: float) -> None:
        """Whether the robot `obeyed` since the last period, and what its IMU measured."""

    def observe(self, known: Situation, now: Moment) -> None:
        """Carry on what is learnt and where the robot is, whatever is done."""

    def coast_error(self, view: VirtualView) -> PoseError | None:
        """In a gap: what is missing to where the robot stays; None if it stays by itself."""

    def led(self, error: PoseError, view: VirtualView, leading: Leading, /) -> PoseError:
        """The error to where `leading` has the robot."""

    def leashed(self, error: PoseError, view: VirtualView, now: Moment, /) -> Leashed:
        """The error to where the robot can be held."""

    def start_place(self) -> None:
        """A press: from here its way counts."""

    def start(self, known: Situation, from_rest: bool, /) -> None:
        """Begin to track, without a jump."""

    def change_mode(
        self, before: Mode, mode: Mode, known: Situation | None, leashed: Leashed | None
    ) -> None:
        """Go from `before` to a `mode` that is not TRACK, without a jump.

        `leashed`: the error to where it should be; None if nobody knows, or in doubt of it.
        """

    def act(
        self, known: Situation | None, leashed: Leashed | None, now: Moment, share: float, /
    ) -> Acted:
        """What the robot is told now: `share` of it, 0 to 1, may reach the robot."""
