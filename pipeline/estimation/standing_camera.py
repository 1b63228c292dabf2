"""Where the robot is in a frame that stands: only while the phone does, as on a tripod.

A picture measures the body relative to the camera. Of a camera that a hand moves this is no place
in a room, nor is its change a velocity there, and nothing else here knows the hand's way through
it. While the phone's own motion sensors feel nothing but gravity for two seconds and more, it is:
in s, whose origin is the camera's, z up, its heading whatever it is. Whenever the phone has moved,
another s begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.frames import Array, R_fc_level_from_specific_force
from pipeline.signals import PhoneImu, RelativePose

STANDS_S = 2.0
"""So long nothing may be felt before a pose counts; the vertical is the mean of that."""
STILL_RAD_S = 0.03
"""What a gyroscope may say of rest, its bias included; hands tremble by more within a second."""
STILL_M_S2 = 0.2
"""By how much a specific force may be off that mean: phones' noise, or a tilt by one degree."""
HOLE_S = 0.2
"""Who knows what happened in a longer silence of its sensors."""


@dataclass(frozen=True, slots=True, eq=False)
class StandingPose:
    """Pose of the body in s at the time of a picture."""

    t: float
    """Capture time [s]."""
    p_bs_in_s: Array
    """(3,) [m]."""
    R_sb: Array
    """(3, 3)."""
    covariance: Array
    """(6, 6) of (δp in s [m], θ in b [rad]) with R = R̂ Exp(θ)."""
    frame: int
    """Another one: another s."""


class StandingCamera:
    """Takes the phone's motion samples and poses, each in its order."""

    def __init__(self) -> None:
        """Nothing felt yet."""
        self._frame, self._is_new = 0, True
        self._since = self._until = -np.inf
        self._phone, self._count = 0, 0
        self._mean_in_c = np.zeros(3)

    def add(self, sample: PhoneImu) -> None:
        """Take what the phone felt."""
        hole = sample.t - self._until > HOLE_S or sample.phone != self._phone
        turns = float(np.linalg.norm(sample.omega_m_cf_in_c)) > STILL_RAD_S
        off = float(np.linalg.norm(sample.a_m_cf_in_c - self._mean_in_c)) > STILL_M_S2
        if hole or turns or off:
            self._since, self._count, self._is_new = sample.t, 0, True
            self._mean_in_c = np.zeros(3)
        self._until, self._phone = sample.t, sample.phone
        if not turns and sample.t <= self._since + STANDS_S:
            self._count += 1
            self._mean_in_c = self._mean_in_c + (sample.a_m_cf_in_c - self._mean_in_c) / self._count

    def pose(self, pose: RelativePose, t: float) -> StandingPose | None:
        """The same pose, of a picture taken at `t`, in s; None: the phone has not stood long."""
        if not self._since + STANDS_S < t <= self._until:
            return None
        self._frame, self._is_new = self._frame + self._is_new, False
        R_sc = R_fc_level_from_specific_force(self._mean_in_c)
        turn = np.eye(6)
        turn[:3, :3] = R_sc
        return StandingPose(
            t,
            R_sc @ pose.p_bc_in_c,
            R_sc @ pose.R_cb,
            turn @ pose.covariance @ turn.T,
            self._frame,
        )
