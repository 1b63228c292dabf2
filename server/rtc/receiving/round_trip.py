"""Round-trip time now, for knowing when a lost packet can be back. Sans-I/O."""

from __future__ import annotations

from collections import deque

REMEMBERED = 60
"""Answers, a second of them: a line that gets worse is noticed, one slow answer is not believed."""
SHARE = 0.75
"""Of the answers that were quicker."""
LONGEST_S = 2.0


class RoundTrip:
    """The upper quartile of the last answers; the least of all would be of a line that was."""

    def __init__(self) -> None:
        """Begin with nothing known."""
        self._last: deque[float] = deque(maxlen=REMEMBERED)

    def add(self, t_asked: float, t_answered: float) -> None:
        """An answer [s]; one that can't be is not believed: its times come from outside."""
        if 0.0 <= t_answered - t_asked <= LONGEST_S:
            self._last.append(t_answered - t_asked)

    @property
    def seconds(self) -> float | None:
        """Round trip at present [s]; None before the first answer."""
        if not self._last:
            return None
        return sorted(self._last)[int(SHARE * len(self._last))]
