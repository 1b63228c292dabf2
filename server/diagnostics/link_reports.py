"""Verdicts on the operator's link, computed beside the event loop and kept for a second."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable

from pipeline.config import FailsafeConfig
from server.diagnostics.link_check import check
from server.diagnostics.link_log import LinkLog, Series
from server.protocol.link_messages import LinkReport

LASTS_S = 1.0
MAX_KEPT = 8
"""Reports, one for each span that is asked for."""
RULES = FailsafeConfig()


class LinkReports:
    """One is computed at a time, in a thread: a minute of a busy link takes some 20 to 80 ms."""

    def __init__(
        self, clock: Callable[[], float], judge: Callable[[Series], LinkReport] | None = None
    ) -> None:
        """Begin without a report."""
        self._clock = clock
        self._judge = judge or (lambda series: check(series, RULES))
        self._one = asyncio.Lock()
        self._kept: OrderedDict[tuple[LinkLog, float], tuple[float, LinkReport]] = OrderedDict()

    async def of(self, link: LinkLog, seconds: float) -> LinkReport:
        """The verdict on the last `seconds`, at most `LASTS_S` old."""
        key = link, round(seconds, 1)
        async with self._one:
            t, report = self._kept.get(key, (-float("inf"), None))
            if report is None or self._clock() - t >= LASTS_S:
                t = self._clock()
                report = await asyncio.to_thread(self._judge, link.series(t, seconds))
                self._kept[key] = t, report
                self._kept.move_to_end(key)
                if len(self._kept) > MAX_KEPT:
                    self._kept.popitem(last=False)
        return report
