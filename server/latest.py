"""Newest wins: a slot that counts what it drops, and a meter of how fresh a stream is."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

from server.messages import Stream

T = TypeVar("T")
WINDOW_S = 2.0


class Latest(Generic[T]):
    """One slot between threads: what was not taken in time is replaced and counted."""

    def __init__(self) -> None:
        """Empty."""
        self._lock = threading.Lock()
        self._value: T | None = None
        self.dropped = 0

    def put(self, value: T) -> None:
        """Replace what is there."""
        with self._lock:
            self.dropped += self._value is not None
            self._value = value

    def take(self) -> T | None:
        """The value, leaving the slot empty; None if it is."""
        with self._lock:
            value, self._value = self._value, None
            return value

    def peek(self) -> T | None:
        """The value, leaving it there."""
        with self._lock:
            return self._value


class Meter:
    """Age, rate and losses of one stream."""

    def __init__(self) -> None:
        """Nothing yet."""
        self._arrivals: deque[float] = deque(maxlen=1000)
        self._t = -float("inf")
        self.dropped = 0

    def tick(self, now: float, t: float | None = None) -> None:
        """An item taken at `t` [s] (now, if not said) has arrived at `now`."""
        self._arrivals.append(now)
        self._t = max(self._t, now if t is None else t)

    def age(self, now: float) -> float:
        """Since the newest item was taken [s]; inf before the first."""
        return now - self._t

    def stream(self, now: float) -> Stream:
        """For a status."""
        while self._arrivals and self._arrivals[0] < now - WINDOW_S:
            self._arrivals.popleft()
        age = self.age(now)
        age_ms = round(1e3 * age, 1) if age < 1e6 else None
        return Stream(age_ms, round(len(self._arrivals) / WINDOW_S, 1), self.dropped)
