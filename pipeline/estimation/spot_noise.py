"""How much more LEDs scatter than vision says of them: by how well they fit each other.

No motion enters, so a hand or an IMU can't pass for it. Upwards in a second, as slowly back.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pipeline.signals import VisionMeasurement

KEPT, PRIOR_FREEDOMS = 0.97, 40.0
"""Of what was learnt, from one picture to the next; believed before the first one."""
TOLERATED: Final = 1.25
"""Chance: σ of the mean of a second of five LEDs is 0.12."""
OUTLYING: Final = 4.0
"""Times what is expected: more than this one picture does not teach."""
MOST: Final = 100.0
"""Factor of a variance. Beyond it is not noise."""


class SpotNoise:
    """By what factor the variances of LEDs' rays are greater than vision has them."""

    def __init__(self) -> None:
        """Begin with vision's own."""
        self._chi2 = self._freedoms = PRIOR_FREEDOMS

    @property
    def factor(self) -> float:
        """Factor of the variances, 1 to `MOST`."""
        ratio = self._chi2 / self._freedoms
        return min(ratio, MOST) if ratio > TOLERATED else 1.0

    def learn(self, chi2: float, freedoms: int) -> None:
        """Learn from a picture's misfit χ², by variances that had the factor."""
        chi2 = min(chi2, OUTLYING * freedoms) * self.factor
        self._chi2 = KEPT * self._chi2 + chi2
        self._freedoms = KEPT * self._freedoms + freedoms

    def inflated(self, seen: VisionMeasurement) -> VisionMeasurement:
        """The same with variances that have the factor."""
        if self.factor == 1.0:
            return seen
        pose, rays = seen.pose, replace(seen.rays, covariances=self.factor * seen.rays.covariances)
        if pose is not None:
            pose = replace(pose, covariance=self.factor * pose.covariance)
        return replace(seen, rays=rays, pose=pose)
