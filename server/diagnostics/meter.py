"""How fresh a stream is: age, rate, losses."""

from __future__ import annotations

from collections import deque

from server.protocol.messages import Stream

WINDOW_S = 2.0


class Meter:
    """Age, rate and losses of one stream."""

    def __init__(self) -> None:
        """Begin without an item."""
        self._arrivals: deque[float] = deque(maxlen=1000)
        self._t = -float("inf")
        self.dropped = 0

    def tick(self, now: float, t: float | None = None) -> None:
        """An item taken at `t` [s] (now, if not said) has arrived at `now`."""
        self._arrivals.append(now)
        self._t = max(self._t, now if t is None else t)

    def age(self, now: float) -> float:
        """Age of the newest item [s]; inf before the first."""
        return now - self._t

    def stream(self, now: float) -> Stream:
        """Health of the stream, for a status."""
        while self._arrivals and self._arrivals[0] < now - WINDOW_S:
            self._arrivals.popleft()
        age = self.age(now)
        age_ms = round(1e3 * age, 1) if age < 1e6 else None
        return Stream(age_ms, round(len(self._arrivals) / WINDOW_S, 1), self.dropped)
