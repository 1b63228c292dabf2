"""Reports on the operator's phone, computed beside the event loop and kept for a second."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

LASTS_S = 1.0
MAX_KEPT = 8
"""Reports, one for each span that is asked for."""
Series = TypeVar("Series")
Series_co = TypeVar("Series_co", covariant=True)
Report = TypeVar("Report")


class Source(Protocol[Series_co]):
    """Whatever remembers; asked on the event loop."""

    def series(self, now: float, seconds: float) -> Series_co:
        """All that came in the last `seconds`, as a value."""


class Reports(Generic[Series, Report]):
    """One is computed at a time, in a thread: a minute of a busy link takes some 20 to 80 ms."""

    def __init__(self, clock: Callable[[], float], judge: Callable[[Series], Report]) -> None:
        """Begin without a report."""
        self._clock, self._judge = clock, judge
        self._one = asyncio.Lock()
        self._kept: OrderedDict[tuple[Source[Series], float], tuple[float, Report]] = OrderedDict()

    async def of(self, source: Source[Series], seconds: float) -> Report:
        """The verdict on the last `seconds`, at most `LASTS_S` old."""
        key = source, round(seconds, 1)
        async with self._one:
            if key in self._kept and self._clock() - self._kept[key][0] < LASTS_S:
                return self._kept[key][1]
            t = self._clock()
            report = await asyncio.to_thread(self._judge, source.series(t, seconds))
            self._kept[key] = t, report
            self._kept.move_to_end(key)
            if len(self._kept) > MAX_KEPT:
                self._kept.popitem(last=False)
        return report
