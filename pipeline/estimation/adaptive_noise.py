"""Adaptive measurement noise of the phone's IMU, learnt from the poses that its samples predict.

A browser hands samples on late, rounds their times or skips some, and dates pictures by its own
clock: what both say of a hand's tremor can differ by ten times the sensors' noise. A filter that
believes the noise alone takes pictures for outliers, and loses the robot. So each picture's own
pose is compared with the one predicted for it: misfit eᵀ S⁻¹ e / 6, with S = P + C.

* Misfits above what is tolerated: the samples' variances grow until there are none, and fade again
  (covariance matching; Mehra, IEEE Trans. Automatic Control 17 (1972) 693).
* One picture far off, by no more than bad samples explain: the covariance predicted for it is
  inflated at once, as far as it missed (strong tracking; Zhou & Frank, Int. J. Control 65 (1996)
  295).

Gyroscope and accelerometer are doubted alike: seen from the camera, a turn moves the robot aside as
a step does, and late samples are late for both.
"""

from __future__ import annotations

import math
from typing import Final

from pipeline.estimation.innovation_kernels import normalised, share_of
from pipeline.frames import Array

GAIN: Final = 0.1
"""Of the factor's logarithm, for each picture whose misfit is one above the tolerated."""
TOLERATED: Final = 1.3
"""1 is expected of a perfect model; six errors scatter, and covariances err."""
SURPRISE: Final = 8.0
"""A greater misfit counts as this."""
FAR: Final = 3.75
"""Misfit that a picture has once in a thousand: 99.9 % of χ² with six degrees, by six."""
MOST: Final = 1e4
"""Factor of a variance that bad samples explain. Beyond, it is no fault of theirs, and the gates of
the LEDs decide."""


class AdaptiveNoise:
    """By what factor the variances of the phone's samples are greater than their data sheet's."""

    def __init__(self) -> None:
        """Begin with the data sheet's noise."""
        self._log = 0.0

    @property
    def factor(self) -> float:
        """Factor of the variances, 1 to `MOST`."""
        return math.exp(self._log)

    def judge(self, e: Array, P: Array, C: Array) -> float:
        """Learn from how far (6,) a picture's own pose C (6, 6) is off the one predicted for it, P.

        Gives the factor, 1 as a rule, by which P must be stretched for this picture.
        """
        S = P + C
        surprise = misfit(e, S)
        step = GAIN * share_of(P, S) * (min(surprise, SURPRISE) - TOLERATED)
        self._log = min(max(self._log + step, 0.0), math.log(MOST))
        if surprise <= FAR:
            return 1.0
        inflation = 2.0
        while inflation * self.factor <= MOST:
            if misfit(e, inflation * P + C) <= 1.0:
                return inflation
            inflation *= 2.0
        return 1.0


def misfit(e: Array, S: Array) -> float:
    """χ² of an innovation (n,) of covariance S (n, n), by its degrees of freedom."""
    return float(normalised(e, S))
