"""Short silences, counted by the side they were on. Sans-I/O."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import msgspec

LATELY_S = 60.0
MANY = 6
"""In the last minute: arming warns."""
SIDES = ("phone", "robot", "server")
WORDS = {
    "phone": "The phone's link had {} gaps in the last minute, the longest {:.2f} s.",
    "robot": "The robot's link had {} gaps in the last minute, the longest {:.2f} s.",
    "server": "The server's computer stood still {} times in a minute, the longest {:.2f} s.",
}


class GapStatistics(msgspec.Struct, array_like=True, frozen=True):
    """Gaps of one side in the last minute."""

    count: int
    longest_s: float


class _Side:
    def __init__(self, least_s: float) -> None:
        self._least_s = least_s
        self._over: deque[tuple[float, float]] = deque()
        self._open_s = 0.0

    def add(self, now: float, silent_s: float) -> None:
        """Take a silence of so long [s]."""
        if silent_s > LATELY_S:  # gone, or never there: that is no gap
            self._open_s = 0.0
        elif silent_s > self._least_s:
            self._open_s = max(self._open_s, silent_s)
        elif self._open_s > 0.0:
            self._over.append((now, self._open_s))
            self._open_s = 0.0
        while self._over and now - self._over[0][0] > LATELY_S:
            self._over.popleft()

    def lately(self) -> GapStatistics:
        lengths = [length for _, length in self._over] + [self._open_s] * (self._open_s > 0.0)
        return GapStatistics(len(lengths), round(max(lengths, default=0.0), 3))


class GapLog:
    """Which side was silent how often in the last minute, and how long at most."""

    def __init__(self, least_s: Mapping[str, float]) -> None:
        """A side that is silent for longer than `least_s` of it [s] has a gap."""
        self._sides = {side: _Side(least_s[side]) for side in SIDES}

    def add(self, now: float, silent_s: Mapping[str, float]) -> None:
        """Every tick: for how long each side has been silent [s]; never yet heard counts not."""
        for side, log in self._sides.items():
            log.add(now, silent_s[side])

    def lately(self) -> dict[str, GapStatistics]:
        """Statistics of each side; a gap that is not over counts."""
        return {side: log.lately() for side, log in self._sides.items()}

    def warnings(self) -> list[str]:
        """Warnings for somebody who arms."""
        lately = self.lately()
        return [
            WORDS[side].format(gaps.count, gaps.longest_s)
            for side, gaps in lately.items()
            if gaps.count >= MANY
        ]
