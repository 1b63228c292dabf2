"""Where another machine's clock stands: of the last answers, the quickest is believed."""

from __future__ import annotations

from collections import deque


class ClockOffset:
    """Remote clock minus our clock, by NTP's rule with the least-delay filter.

    Delay is noisy in one direction only (waiting makes it longer), so the answer with the shortest
    round trip of the last `window` has the best offset; the window also lets the estimate follow a
    drifting clock.
    """

    def __init__(self, window: int = 20, needed: int = 5) -> None:
        """Keep `window` answers; be ready after `needed`."""
        self._answers: deque[tuple[float, float]] = deque(maxlen=window)
        self._needed = needed

    def add(self, t_asked: float, t_remote: float, t_answered: float) -> None:
        """Take an answer: asked and answered on our clock [s], stamped `t_remote` on theirs [s]."""
        delay = t_answered - t_asked
        if delay >= 0.0:
            self._answers.append((delay, t_remote - 0.5 * (t_asked + t_answered)))

    @property
    def ready(self) -> bool:
        """Enough answers to trust it."""
        return len(self._answers) >= self._needed

    @property
    def offset(self) -> float:
        """Remote minus ours [s]. Raises ValueError before the first answer."""
        return min(self._answers)[1]

    @property
    def round_trip(self) -> float:
        """The shortest round trip [s]; half of it bounds the error."""
        return min(self._answers)[0]

    def local(self, t_remote: float) -> float:
        """Our time at the remote time `t_remote` [s]."""
        return t_remote - self.offset
