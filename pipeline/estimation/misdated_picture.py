"""Pictures that are dated badly: beside their place along their own motion.

A busy browser now and then gives a picture the time of another one, 10 to 35 ms off. At that time
the robot was elsewhere in the picture: the pose is off by what it moves meanwhile, in place and
attitude together. Fused as it is, such a picture leaves a speed behind that nothing had; if the
prediction is doubted for it instead, its speed is doubted most, and the next picture, right again,
tears it away. So what the date explains is believed less, along its motion alone. Only once: what
is beside twice running is no stumble.

If the same date explains both, pictures are dated otherwise from now on: a camera that exposes for
longer, or gives fewer pictures a second, is dated up to half a period beside what was learnt.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite, isinf
from typing import Final

import numpy as np

from pipeline.estimation.adaptive_noise import FAR, misfit
from pipeline.estimation.believed_less import widened
from pipeline.frames import Array
from pipeline.signals import VisionMeasurement

STUMBLE_S: Final = 0.02
"""Standard deviation of a date that is wrong."""
ALIKE_S: Final = 0.006
"""Two pictures running whose dates are wrong by the same, as far as pictures tell. One that stands
or is steadied gets later by a period with each."""


class MisdatedPictures:
    """Tells them from those for which the prediction is wrong."""

    def __init__(self) -> None:
        """None so far."""
        self._was_far = False
        self._dates = RunningDates()
        self.are_redated = False
        """The same date explains the last two pictures."""

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
        late_s = late_by(e, S, passing) if self._was_far else inf
        self.are_redated = self._dates.are_alike(late_s)
        if was_far or seen.pose is None or isinf(late_s):
            return None
        moved = late_s * passing
        pose, rays = widened(seen.pose, seen.rays, leds_in_b, moved[:3], moved[3:])
        return replace(seen, pose=pose, rays=rays)


def late_by(e: Array, S: Array, passing: Array) -> float:
    """How much later than dated a picture was taken, as it is off by e (n,) [s]; inf: not by that.

    Covariance S (n, n) of e, were its date right; `passing` (n,) as in `MisdatedPictures`.
    """
    misdated = S + STUMBLE_S**2 * np.outer(passing, passing)
    if misfit(e, misdated) > FAR:
        return inf
    return STUMBLE_S**2 * float(passing @ np.linalg.solve(misdated, e))


class RunningDates:
    """How much later than dated the picture before was taken."""

    def __init__(self) -> None:
        """Not known."""
        self._late_s = inf

    def are_alike(self, late_s: float) -> bool:
        """Take a picture's own [s], or inf; tells whether it is that of the one before."""
        before_s, self._late_s = self._late_s, late_s
        return isfinite(before_s) and abs(late_s - before_s) < ALIKE_S
