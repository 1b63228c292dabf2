"""What share of a phone's trembling its picture hides, by a glass and the phone's gyroscope.

A hand trembles at 4 to 12 Hz; a stabiliser takes that out of the picture. What is compared is the
size of the glass's jumps from one picture to the next and back, as seen and as the gyroscope
predicts them: dates that are wrong put jumps elsewhere and leave their size (`steadied_picture`).
So near a glass a hand that turns about its wrist moves the phone as well: jumps are larger or
smaller by that, which is part of the doubt.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.imu_stream import ImuStream
from pipeline.signals import PhoneImu, RelativePose
from pipeline.vision.steadied_picture import EVEN, LONGEST_S

KEPT: Final = 1800
"""Jumps: a minute's."""
LEAST: Final = 60
LEAST_RAD: Final = 1e-3
"""RMS of predicted jumps that tell anything: the glass's middle is seen to a tenth of it."""
LEVER_M: Final = 0.1
"""From a wrist to a phone: what turns about the one moves the other."""


@dataclass(frozen=True, slots=True)
class HeldTurning:
    """Share of trembling that pictures do not show."""

    value: float
    """1: a picture that stands still."""
    sigma: float


class TurnMeter:
    """Feed it each motion sample, and each pose of the glass once the samples of then have come."""

    def __init__(self) -> None:
        """Nothing has turned."""
        self._imu = ImuStream()
        self._last: RelativePose | None = None
        self._moved: Array | None = None
        """(2, 2) by which the glass's middle moved last, as seen and as predicted [rad]."""
        self._apart = 0.0
        self._jumps: deque[tuple[float, float]] = deque(maxlen=KEPT)
        """Squares, as seen and as predicted [rad²]."""
        self._distance_m = np.inf

    def add_phone_imu(self, sample: PhoneImu) -> None:
        """The phone has moved."""
        self._imu.insert(sample.t, sample.omega_m_cf_in_c, sample.a_m_cf_in_c)

    def add_pose(self, pose: RelativePose) -> None:
        """A picture shows the glass so."""
        last, before, apart = self._last, self._moved, self._apart
        self._last, self._moved = pose, None
        if last is None or not 0.0 < pose.t - last.t < LONGEST_S:
            return
        if not (self._imu.oldest <= last.t and pose.t <= self._imu.newest):
            return
        middle, turn = last.p_bc_in_c, self._imu.turn(last.t, pose.t)
        moved = np.array([_tangents(pose.p_bc_in_c), _tangents(turn.T @ middle)])
        self._moved, self._apart = moved - _tangents(middle), pose.t - last.t
        self._distance_m = float(np.linalg.norm(middle))
        if before is not None and abs(self._apart - apart) < EVEN * self._apart:
            seen, predicted = np.square(self._moved - before).sum(axis=1).tolist()
            self._jumps.append((seen, predicted))

    def held(self) -> HeldTurning | None:
        """The share, once the phone has trembled enough; any thread may ask."""
        jumps = self._jumps.copy()
        if len(jumps) < LEAST:
            return None
        seen, predicted = np.mean(jumps, axis=0).tolist()
        if predicted < LEAST_RAD**2:
            return None
        sigma = hypot(float(np.sqrt(0.5 / len(jumps))), LEVER_M / self._distance_m)
        return HeldTurning(1.0 - float(np.sqrt(seen / predicted)), sigma)


def _tangents(point: Array) -> Array:
    """(2,) to the left and up of a point (3,) before the camera."""
    flat: Array = point[1:] / point[0]
    return flat
