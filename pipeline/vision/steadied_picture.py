"""Whether pictures jump to and fro with the phone that takes them, or a stabiliser steadies them.

A hand trembles at 4 to 12 Hz, so what a picture shows jumps aside from one to the next, and back.
The phone's gyroscope predicts how far. A stabiliser takes most of it out: the jumps that are seen
are smaller than those predicted. Samples that a busy browser reads late, or of a wrong time, put
the jumps elsewhere and leave their size: so the one is told from the other, whenever it began.

A robot that moves on evenly is predicted to jump in a picture that is dated wrongly, and after some
that were not believed: only pictures count that follow a believed one, and are as far from it as
that from the one before.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array

MEMORY: Final = 0.1
"""Share of each picture in what is remembered."""
STEADIED: Final = 0.4
"""Of the predicted jumps, squared: measured were 0.9 and more of honest pictures by all codecs,
0.45 with late samples, 0.2 with those that are also held while the hand trembles (which do not
last); steadied ones show 0.3 and less."""
CLEAR: Final = 15.0
"""Times the variance of where a picture is predicted: so far the predicted jumps are no noise."""
LONGEST_S: Final = 0.1
"""Between two pictures: in more a hand trembles to and fro, and the jumps of pictures farther apart
are those of who leads, and of what is learnt of the speed from picture to picture."""
EVEN: Final = 0.25
"""By so much of it the time between two pictures may differ from the time between those before."""
PICTURES: Final = 6
"""Clearly steadied ones in a row, until it is said."""


class SteadiedPicture:
    """Follows the robot's jumps in pictures, across the line of sight."""

    def __init__(self) -> None:
        """Nothing seen yet."""
        self._moved, self._jumps = np.zeros((2, 2)), np.zeros(2)
        """Since the picture before: as seen, as predicted [m]; mean square of how that changed."""
        self._clear = 0
        self._t, self._apart = 0.0, 0.0

    def add(self, t: float, since: float, seen: Array, predicted: Array, variance: float) -> None:
        """Take how far the robot moved in a picture of `t` [s], and should have moved.

        Args:
            t: When it was taken [s].
            since: When the last one was taken that was believed [s].
            seen: (2,) along y and z of c [m].
            predicted: (2,) likewise [m].
            variance: Of the difference [m²], both axes together.
        """
        moved, apart = np.array([seen, predicted]), t - since
        is_even = since == self._t and abs(apart - self._apart) < EVEN * apart < EVEN * LONGEST_S
        self._t, self._apart = t, apart
        if not is_even:  # what was seen before is forgotten bit by bit: nobody stays accused by it
            self._jumps += MEMORY * (self._jumps.mean() - self._jumps)
            self._moved, self._clear = moved, 0
            return
        self._jumps += MEMORY * (np.square(moved - self._moved).sum(axis=1) - self._jumps)
        self._moved = moved
        is_clear = self.is_still and self._jumps[1] > CLEAR * variance
        self._clear = self._clear + 1 if is_clear else 0

    @property
    def is_still(self) -> bool:
        """It jumps less than predicted."""
        return bool(self._jumps[0] < STEADIED * self._jumps[1])

    @property
    def is_clear(self) -> bool:
        """Beyond noise, so that no sample can be doubted for where the robot is seen."""
        return self._clear > 0

    @property
    def is_steadied(self) -> bool:
        """For long enough to be said."""
        return self._clear >= PICTURES
