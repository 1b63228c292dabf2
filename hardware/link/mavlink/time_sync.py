"""An autopilot's clock and ours, by TIMESYNC: each asks, each answers. Times are [s], monotonic.

Who asks says when by his own clock, who answers adds when by his: half of the round trip is taken
for the way there, and of the last answers the quickest is believed. It tells what no stamp of a
message can, how long the quickest of them is on its way.
"""

from __future__ import annotations

from collections import deque

EVERY_S = 0.2
"""We ask."""
QUICKEST_OF = 16
"""Answers: clocks part by 0.2 ms meanwhile at 50 ppm."""
ASKED = 8
"""Questions that may still be answered."""
LONGEST_S = 0.5
"""An answer that took longer tells too little."""
SLACK_S = 0.005
"""Answers that exclude each other by more are those of a clock that has been set."""
NS_PER_S = 1_000_000_000


class TimeSync:
    """How far an autopilot's clock is before ours."""

    def __init__(self) -> None:
        """Nothing asked."""
        self._asked: deque[int] = deque(maxlen=ASKED)
        self._answers: deque[tuple[float, float]] = deque(maxlen=QUICKEST_OF)
        """Round trip and how far ahead."""

    def question(self, now: float) -> tuple[int, int]:
        """The fields of a TIMESYNC that asks."""
        ours_ns = round(NS_PER_S * now)
        self._asked.append(ours_ns)
        return 0, ours_ns

    @staticmethod
    def answer(theirs_ns: int, now: float) -> tuple[int, int]:
        """The fields of the one that answers theirs."""
        return round(NS_PER_S * now), theirs_ns

    def hear(self, theirs_ns: int, ours_ns: int, now: float) -> None:
        """An answer has come."""
        if ours_ns not in self._asked:
            return
        self._asked.remove(ours_ns)
        took = now - ours_ns / NS_PER_S
        if not 0.0 <= took <= LONGEST_S:
            return
        ahead = theirs_ns / NS_PER_S - (now - 0.5 * took)
        if self._answers:
            least, before = min(self._answers)
            if abs(ahead - before) > 0.5 * (took + least) + SLACK_S:
                self._answers.clear()
        self._answers.append((took, ahead))

    def ours(self, theirs: float) -> float | None:
        """A time of the autopilot's clock on ours; None: it has not answered yet."""
        if not self._answers:
            return None
        return theirs - min(self._answers)[1]
