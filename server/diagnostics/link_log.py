"""What came of a phone when, for the last minute: what `link_check` judges. Sans-I/O."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

KEPT_S = 60.0
MOST = 20_000
"""Entries of one kind, whatever a phone sends."""
Arrival = tuple[float, float]
"""When it was made (a PING: asked for), and when it came [s]."""


@dataclass(frozen=True, slots=True)
class Series:
    """Arrivals from `begin` to `end` [s]; each in the order of coming."""

    begin: float
    end: float
    asked: tuple[float, ...] = ()
    """When PINGs went out, answered or not."""
    answers: tuple[Arrival, ...] = ()
    """Of PINGs: signs of life."""
    motion: tuple[Arrival, ...] = ()
    pictures: tuple[Arrival, ...] = ()


class LinkLog:
    """Remembers a minute, or all of a recording."""

    def __init__(self, now: float, kept_s: float = KEPT_S, most: int | None = MOST) -> None:
        """Begin empty at `now` [s]."""
        self._begin, self._kept_s = now, kept_s
        self._asked: deque[float] = deque(maxlen=most)
        self._kinds = {
            kind: deque[Arrival](maxlen=most) for kind in ("answers", "motion", "pictures")
        }

    def asked(self, now: float) -> None:
        """A PING goes out."""
        self._asked.append(now)

    def came(self, kind: str, t: float, now: float) -> None:
        """Note one of `answers`, `motion`, `pictures`, made at `t` [s], received at `now` [s]."""
        self._kinds[kind].append((t, now))

    def series(self, now: float, seconds: float) -> Series:
        """The last `seconds`, or since the beginning if that was later."""
        begin = max(self._begin, now - min(seconds, self._kept_s))
        return Series(
            begin,
            now,
            tuple(t for t in self._asked if t >= begin),
            **{kind: _since(begin, arrivals) for kind, arrivals in self._kinds.items()},
        )


def _since(begin: float, arrivals: Iterable[Arrival]) -> tuple[Arrival, ...]:
    return tuple(arrival for arrival in arrivals if arrival[1] >= begin)
