"""A twist as the pose that a robot is to take: where it is to go next, added up from where it was.

Most arms, and many bodies with a controller of their own, follow a pose. One that follows it with
a time constant moves as one that follows a velocity with the same: its place lags behind by lag
times speed, both ways. So control's twist is added up, and all that holds of a twist (limits,
braking in silence, delay and lag of `[twist]`) holds of it. What differs:

* In silence the pose stays, and the robot stands as soon as it is there: sooner than by a twist.
* The sum never runs ahead of the robot by more than it lags at its largest speed, twice: held by a
  wall, it pushes by so much and no more, and comes away at once.
* At rest nothing is said: whoever else moves the robot is not pulled back. A motion begins where
  the last one ended, so that a robot that sags below what it is told does not sag again each time;
  where it is, if it is elsewhere or has started anew: so may its odometry have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array, exp, log
from pipeline.robot import TwistDrive

REST_S = 0.5
"""After the last motion it has come to where it was told to go, and is told so no more."""
LONGEST_S = 0.02
"""Of one step: commands come 200 times a second, and what was missed is not caught up."""
LAGS = 2.0
"""How far the set-point may be ahead, in what the robot lags behind at its largest speed ..."""
SAG, SAG_RAD = 0.01, 0.02
"""... and beside, for a robot that sags or has play [m], [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class BasePose:
    """Where a body b is in the axes k of what carries it: a base, a map, odometry's origin."""

    R_kb: Array
    """(3, 3)."""
    p_bk_in_k: Array
    """(3,) [m]."""
    frame: str
    """The name that the robot has for k."""


class PoseSetpoint:
    """Of one robot. Times are [s], monotonic."""

    def __init__(self, drive: TwistDrive) -> None:
        """Nobody has moved it."""
        behind_s = LAGS * (drive.lag_s + drive.delay_s)
        self._farthest = drive.speed * behind_s + SAG
        self._farthest_rad = drive.rate * behind_s + SAG_RAD
        self._pose: BasePose | None = None
        self._boot_id = 0
        self._moved, self._last = -np.inf, -np.inf

    def next(
        self, twist_in_b: Array, measured: BasePose | None, now: float, boot_id: int = 0
    ) -> BasePose | None:
        """The pose to be told now, for a twist (6,) [m/s, rad/s]; None: say nothing.

        `measured` is where the robot is; None: it has not said so. With another `boot_id` it has
        started anew.
        """
        dt, self._last = min(now - self._last, LONGEST_S), now
        if measured is None:
            return None
        if boot_id != self._boot_id:
            self._pose, self._boot_id = None, boot_id
        rests = now - self._moved > REST_S
        if twist_in_b.any():
            if self._pose is None or (rests and self._is_far(self._pose, measured)):
                self._pose = measured
            self._moved = now
        elif rests or self._pose is None:
            return None
        pose = self._pose
        p_in_k = pose.p_bk_in_k + dt * pose.R_kb @ twist_in_b[:3]
        ahead = BasePose(pose.R_kb @ exp(dt * twist_in_b[3:]), p_in_k, measured.frame)
        self._pose = self._held(ahead, measured)
        return self._pose

    def _is_far(self, pose: BasePose, measured: BasePose) -> bool:
        """Whether it is farther ahead than it may be."""
        ahead_in_k, turned = _ahead(pose, measured)
        return _length(ahead_in_k) > self._farthest or _length(turned) > self._farthest_rad

    def _held(self, pose: BasePose, measured: BasePose) -> BasePose:
        """The same, or as far in its direction as it may be ahead."""
        if not self._is_far(pose, measured):
            return pose
        ahead_in_k, turned = _ahead(pose, measured)
        ahead_in_k *= min(1.0, self._farthest / max(_length(ahead_in_k), 1e-12))
        turned *= min(1.0, self._farthest_rad / max(_length(turned), 1e-12))
        p_in_k = measured.p_bk_in_k + ahead_in_k
        return BasePose(measured.R_kb @ exp(turned), p_in_k, measured.frame)


def _ahead(pose: BasePose, measured: BasePose) -> tuple[Array, Array]:
    """How far it is (3,) in k [m], and how far turned (3,) in the measured b [rad]."""
    return pose.p_bk_in_k - measured.p_bk_in_k, log(measured.R_kb.T @ pose.R_kb)


def _length(v: Array) -> float:
    return float(np.linalg.norm(v))
