"""A clock that we can't read: what it stamped, dated on ours."""

from __future__ import annotations

from collections import deque

CLOCK_SET_S = 1.0
"""A stamp that is farther from where the last one lets it be: that clock has been set anew."""
CLOCK_BACK_S = 0.11
"""A stamp that is so far behind the last one, and what comes after it so late: likewise. No network
lets a message overtake so many and is late from then on; ntpd sets a clock by 0.128 s at least."""
QUICKEST_OF = 200
"""Samples of which the quickest dates the newest; `BodyClock` of the server does the same."""


class StampClock:
    """Dates stamps on our clock: the quickest of the last ones took no time. Times are [s]."""

    def __init__(self) -> None:
        """No stamp yet."""
        self._excess: deque[float] = deque(maxlen=QUICKEST_OF)
        self._last = (-1.0, -1.0)
        """Stamp and arrival."""
        self._went_back = False
        """Since then, by more than `CLOCK_BACK_S`."""

    def is_set_anew(self, stamp: float, now: float) -> bool:
        """Whether that is no time that the clock can have come to since the last stamp."""
        if not self._excess:
            return False
        passed, went = now - self._last[1], stamp - self._last[0]
        if went < -CLOCK_SET_S or went > passed + CLOCK_SET_S:
            return True
        late = now - stamp - min(self._excess)
        return self._went_back and went > 0.0 and late > CLOCK_BACK_S

    def dated(self, stamp: float, now: float) -> float | None:
        """When that was on our clock; None: not after the last one."""
        if self._excess and stamp <= self._last[0]:
            self._went_back = self._went_back or stamp < self._last[0] - CLOCK_BACK_S
            return None
        self._last, self._went_back = (stamp, now), False
        self._excess.append(now - stamp)
        return stamp + min(self._excess)
