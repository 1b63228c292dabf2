"""A gyroscope in a hand never says the same twice: what does is old, whatever time it bears.

A browser reads motion sensors on a timer of its own, from a memory that the sensors' process fills
(Chromium), or their newest sample (WebKit). If that process waits, or is slower than the timer, the
last sample comes again, under a new time. Believed, it says that the hand turns on as it did, as
surely as a sample can: 0.07 s of it ended flights. Left out, it is a gap like any other.

A phone that lies on a table repeats itself too, for browsers round: so a repetition is old only of
a gyroscope that has been changing, and not for ever.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.frames import Array

LATELY: Final = 0.125
"""Share of each new sample in what is remembered of how many axes change with it."""
CHANGES: Final = 0.75
"""Share of the axes; beyond, all three repeat themselves once in 50 by chance."""
REST_S: Final = 1.5
"""A phone that was put down says the same for longer; a flight has ended by then."""


class HeldGyroscope:
    """Tells samples that are none; feed it all of one phone, in the order of their times."""

    def __init__(self) -> None:
        """Begin before the first sample."""
        self._last, self._t_said = np.full(3, np.nan), -np.inf
        self._changes = 0.0

    def is_old(self, t: float, omega: Array) -> bool:
        """Whether a sample (3,) of `t` [s] is the one before it once more."""
        changed = omega != self._last
        if changed.any():
            self._changes += LATELY * (float(changed.mean()) - self._changes)
            self._last, self._t_said = omega, t
            return False
        if t - self._t_said >= REST_S:
            self._changes = 0.0
        return self._changes > CHANGES
