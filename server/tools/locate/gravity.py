"""If gravity denies what the lights say, the motion sensors' axes are mixed up: how?"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array, R_cd, R_co
from pipeline.vision.gating import angle_between
from server.tools.locate.work import Located

ENOUGH: Final = 5
"""Poses that gravity denies, before it is doubted; and more than those that it confirms."""
FITS_DEG: Final = 12.0
MISTAKES: Final = (
    ("{imu} is in optical axes (x right, y down, z forward)", R_co),
    ("an accelerometer has the opposite sign (+9.8 up at rest is right)", -np.eye(3)),
    ("{imu} is in the axes of a phone held upright (x right, y up, z to its user)", R_cd(0.0)),
    ("{imu} is in the axes of a phone turned left (y right, x down)", R_cd(90.0)),
    ("{imu} is in the axes of a phone turned right", R_cd(270.0)),
    ("{imu} is in axes x right, y forward, z up", np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])),
)


class GravityDoubt:
    """Collects the poses that pictures show and gravity denies."""

    def __init__(self) -> None:
        """Begin without a doubt."""
        self._confirmed = 0
        self._pairs: list[tuple[Array, Array]] = []

    def add(self, located: Located) -> None:
        """Take a frame."""
        up_in_c, up_in_b = located.prior.up_in_c, located.prior.up_in_b
        self._confirmed += located.pose is not None
        denied = located.detection.unbelieved if located.detection is not None else None
        if denied is not None and up_in_c is not None and up_in_b is not None:
            self._pairs.append((up_in_c, denied.R_cb @ up_in_b))

    def words(self, imu: str, body: str) -> list[str]:
        """What is probably wrong with the files of these names; empty if nothing."""
        n = len(self._pairs)
        if n < ENOUGH or n <= self._confirmed:
            return []
        by = self._angle(np.eye(3))
        words = f"in {n} frames the lights give a pose that gravity denies by {by:.0f}°: "
        angle, why = min((self._angle(R), why) for why, R in MISTAKES)
        if angle < FITS_DEG:
            return [f"{words}perhaps {why.format(imu=imu)}; then it would fit to {angle:.0f}°"]
        return [
            f"{words}{imu} must be in camera axes (x forward, y left, z up), {body} in those of"
            " the robot file"
        ]

    def _angle(self, R: Array) -> float:
        """Median between both verticals if the camera's is turned by R (3, 3) [°]."""
        angles = [angle_between(R @ up_in_c, seen) for up_in_c, seen in self._pairs]
        return float(np.rad2deg(np.median(angles)))
