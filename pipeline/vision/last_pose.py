"""The last believed pose of a camera's robot, and what it predicts for the next picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from pipeline.frames import Array, exp, log
from pipeline.prediction import Prediction
from pipeline.signals import RelativePose

FORGET_MISSES = 3
FOLLOWED = 3
"""Fewer poses, and the attitude is forgotten with the place: what was seen but once was no robot,
and whoever has another attitude than is remembered would be searched for in vain."""
MAX_STEP_S = 0.5
"""Longer between pictures: the last pose predicts nothing."""
CONTRADICTION_SIGMAS, CONTRADICTION_M, CONTRADICTION_RAD = 5.0, 0.03, 0.05
"""A believed pose farther than this from where a filter expected it: the filter is wrong."""

BLIND_M_S = 0.3
"""How fast an LED moves in c if nothing tells."""
OLD, OLD_BLIND = 0.6, 1.0
"""Share of what a mean velocity changes by that it is off in the picture at its end, half a period
on (0.5 where that changes slowly, 0.57 for 7 Hz at 30 fps); without gyroscopes turning is in it."""
UNSTEADY_M_S, KEPT = 0.1, 0.9
"""How much a velocity changes from one picture to the next, before that is learnt; what a picture
leaves of what was learnt."""

MEMORY_RAD, GYRO_RAD_S, BLIND_RAD_S, MEMORY_MOST_RAD = 0.2, 0.03, 1.5, 0.6
"""How far a remembered attitude may be off: at first, growing by the second with and without
gyroscopes; farther, it says nothing."""

REACH_M, REACH_SIGMAS = 0.3, 5.0
"""So far from where it is predicted nobody's robot is; and a filter's doubt besides."""
REACH_M_S2 = 1.0
"""How hard it may have changed its speed since it was seen."""
REACHED_S = 10.0
"""So long after it was seen it may be anywhere: no flight lasts as long without a picture."""

Place = tuple[Array, Array]
"""p_bc_in_c (3,) [m] and R_cb (3, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class PossiblePlace:
    """Where a robot may be that was seen not long ago."""

    p_bc_in_c: Array
    """(3,) [m]."""
    radius_m: float

    def holds(self, pose: RelativePose) -> bool:
        """Whether it may be there."""
        off = pose.p_bc_in_c - self.p_bc_in_c
        return bool(off @ off < self.radius_m**2)


PossiblePlaces = Sequence[PossiblePlace]


class LastPose:
    """Kept from picture to picture; its place is forgotten soon, its attitude later.

    Both gyroscopes carry the attitude on: that names LEDs when the robot comes back into sight.
    """

    def __init__(self) -> None:
        """Nothing seen yet."""
        self._pose: RelativePose | None = None
        self._kept: RelativePose | None = None
        """The same, until it may be anywhere."""
        self._R_cb: Array | None = None
        """Carried to the newest picture."""
        self._t, self._t_seen = -np.inf, -np.inf
        """Of the newest picture; of the last believed pose."""
        self._followed = 0
        """Poses since nothing was remembered."""
        self._sure = False
        """Gyroscopes alone have carried the attitude since then."""
        self._since_kept = np.zeros(3)
        """How c turned since then [rad], in c."""
        self._omega: tuple[Array, Array] | None = None
        """At the newest picture: of c, of b."""
        self.turned: Array | None = None
        """(2, 3) how c and b turned between the last two pictures [rad]; None if unknown."""
        self.u_in_c = np.zeros(3)
        """Velocity in c with the camera's turning taken out, between the last two poses [m/s]."""
        self._knows_u = False
        """It is that, not 0 for want of a second pose."""
        self._change2 = UNSTEADY_M_S**2
        """Mean square of how much it changes from picture to picture, in each axis across the line
        of sight [m²/s²]."""
        self.omega_in_b = np.zeros(3)
        """How b turned in c between them [rad/s]; only without gyroscopes, else 0."""
        self._misses = 0
        self.contradicts = False
        """It was not where a filter expected it: until they agree, the filter is not asked."""

    def advance(self, t: float, omega_cf_in_c: Array | None, omega_bf_in_b: Array | None) -> None:
        """Carry the prediction on to a picture of time `t` [s]."""
        dt, before = t - self._t, self._omega
        self._omega = (
            (omega_cf_in_c, omega_bf_in_b)
            if omega_cf_in_c is not None and omega_bf_in_b is not None
            else None
        )
        self._t = t
        self.turned = None
        if not 0.0 < dt < MAX_STEP_S:
            self._lose()
            return
        if self._omega is None:
            self._sure = False
            if self._R_cb is not None and self._pose is not None:
                self._R_cb = self._R_cb @ exp(dt * self.omega_in_b)
            return
        first = before if before is not None else self._omega
        self.turned = 0.5 * dt * (np.array(first) + np.array(self._omega))
        self._since_kept = self._since_kept + self.turned[0]
        if self._R_cb is not None:
            self._R_cb = exp(-self.turned[0]) @ self._R_cb @ exp(self.turned[1])

    def keep(self, pose: RelativePose, expected: Prediction | None) -> None:
        """`pose` was believed, where a filter had `expected` the robot."""
        last, back = self._pose, exp(self._since_kept)
        before, knew_u = back.T @ self.u_in_c, self._knows_u
        self.u_in_c, self.omega_in_b, self._knows_u = np.zeros(3), np.zeros(3), False
        self._followed += 1
        if last is not None and 0.0 < pose.t - last.t < MAX_STEP_S:
            shift = back @ pose.p_bc_in_c - last.p_bc_in_c
            self.u_in_c, self._knows_u = back.T @ shift / (pose.t - last.t), True
            if knew_u:
                change = self.u_in_c[1:] - before[1:]
                self._change2 = KEPT * self._change2 + (1.0 - KEPT) * 0.5 * float(change @ change)
            if self._omega is None:
                self.omega_in_b = log(last.R_cb.T @ pose.R_cb) / (pose.t - last.t)
        self._pose, self._R_cb, self._misses = pose, pose.R_cb, 0
        self._kept = pose
        self._t = self._t_seen = pose.t
        self._sure, self._since_kept = True, np.zeros(3)
        self.contradicts = expected is not None and _contradict(pose, expected)

    @property
    def sigma_u(self) -> float:
        """How well `u_in_c` tells the velocity in the next picture, in each axis [m/s].

        It is the mean over the time before: off by about as much as that changes.
        """
        if self._pose is None or not self._knows_u:
            return BLIND_M_S
        return (OLD if self._omega is not None else OLD_BLIND) * sqrt(self._change2)

    def forget(self) -> None:
        """Predict nothing, not even the attitude; the robot may be anywhere."""
        self._lose()
        self._t_seen = -np.inf

    def _lose(self) -> None:
        self._pose, self._R_cb, self._misses, self._followed = None, None, 0, 0
        self._kept = None

    def miss(self) -> None:
        """Note a picture that gave no pose."""
        self._misses += 1
        if self._misses >= FORGET_MISSES:
            self._pose = None
            if self._followed < FOLLOWED:
                self._R_cb, self._followed = None, 0

    def predicted(self) -> Place | None:
        """Predict the pose at the newest picture, by both gyroscopes and the last velocity."""
        last, R_cb = self._pose, self._R_cb
        if last is None or R_cb is None or not 0.0 < self._t - last.t < MAX_STEP_S:
            return None
        dt = min(self._t - last.t, 0.1)
        ahead = exp(-self._since_kept)
        return ahead @ last.p_bc_in_c + dt * (ahead @ self.u_in_c), R_cb

    def reach(self, expected: Prediction | None) -> PossiblePlaces:
        """Where the robot may be in the newest picture; none: anywhere.

        By the last pose, and by the filter that expects it unless the last pose contradicts it;
        either may be wrong: a filter of its doubt, the last pose about the way since then.
        """
        last, dt, places = self._kept, self._t - self._t_seen, []
        if not 0.0 <= dt < REACHED_S:
            return []
        if expected is not None and not self.contradicts:
            radius_m = REACH_M + REACH_SIGMAS * expected.sigma_p
            places.append(PossiblePlace(expected.p_bc_in_c, radius_m))
        if last is not None:
            p = exp(-self._since_kept) @ last.p_bc_in_c
            radius_m = REACH_M + 0.5 * REACH_M_S2 * dt * dt
            radius_m += float(np.linalg.norm(self.u_in_c)) * dt
            if not self._sure:
                radius_m += BLIND_RAD_S * dt * float(np.linalg.norm(p))
            places.append(PossiblePlace(p, radius_m))
        return places

    def attitude(self) -> tuple[Array, float] | None:
        """For the newest picture, R_cb and how far that may be off [rad]; None if it is too far."""
        if self._R_cb is None:
            return None
        drift = GYRO_RAD_S if self._sure else BLIND_RAD_S
        off = MEMORY_RAD + drift * (self._t - self._t_seen)
        return (self._R_cb, off) if off < MEMORY_MOST_RAD else None


def _contradict(pose: RelativePose, expected: Prediction) -> bool:
    """Whether not both can be true."""
    shift, turn = pose.p_bc_in_c - expected.p_bc_in_c, log(expected.R_cb.T @ pose.R_cb)
    sigma_p = np.hypot(expected.sigma_p, pose.sigma_p)
    sigma_theta = np.hypot(expected.sigma_theta, pose.sigma_theta)
    far_m = CONTRADICTION_SIGMAS * sigma_p + CONTRADICTION_M
    far_rad = CONTRADICTION_SIGMAS * sigma_theta + CONTRADICTION_RAD
    return not (shift @ shift < far_m**2 and turn @ turn < far_rad**2)
