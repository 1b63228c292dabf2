"""A picture that is dated badly: beside its place along its own motion, once.

A busy browser now and then gives a picture the time of another one, 10 to 35 ms off. At that time
the robot was elsewhere in the picture: the pose is off by what it moves meanwhile, in place and
attitude together. Fused as it is, such a picture leaves a speed behind that nothing had; if the
prediction is doubted for it instead, its speed is doubted most, and the next picture, right again,
tears it away. So what the date explains is believed less, along its motion alone. Only once: what
is beside twice running is no stumble.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pipeline.estimation.adaptive_noise import FAR, misfit
from pipeline.estimation.believed_less import widened
from pipeline.frames import Array
from pipeline.signals import VisionMeasurement

STUMBLE_S: Final = 0.02
"""Standard deviation of a date that is wrong."""


class MisdatedPictures:
    """Tells them from those for which the prediction is wrong."""

    def __init__(self) -> None:
        """None so far."""
        self._was_far = False

    def explained(
        self, seen: VisionMeasurement, leds_in_b: Array, e: Array, S: Array, passing: Array
    ) -> VisionMeasurement | None:
        """The same, believed less, if its date explains how far it is off; else None.

        Args:
            seen: A picture with a pose.
            leds_in_b: (n, 3) [m].
            e: (6,) by how much its pose is off what was predicted: δp in c [m], θ in b [rad].
            S: (6, 6) covariance of that, were its date right.
            passing: (6,) how the predicted pose passes: ṗ in c [m/s], attitude in b [rad/s].
        """
        was_far, self._was_far = self._was_far, misfit(e, S) > FAR
        if not self._was_far or was_far or seen.pose is None:
            return None
        stumbled = S + STUMBLE_S**2 * np.outer(passing, passing)
        if misfit(e, stumbled) > FAR:
            return None
        late_s = STUMBLE_S**2 * float(passing @ np.linalg.solve(stumbled, e))
        moved = late_s * passing
        pose, rays = widened(seen.pose, seen.rays, leds_in_b, moved[:3], moved[3:])
        return replace(seen, pose=pose, rays=rays)
