"""Clock synchronisation: offset and drift of another machine's clock, from round trips.

An answer proves that the other clock read `t_remote` somewhen between question and answer: it
bounds the offset from both sides. The offset is a straight line over the last seconds; of all lines
that keep every bound, the one with the most room on both sides is believed, and how far the others
may be from it is the error nobody can argue with (asymmetric delays included).
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from math import inf, isfinite
from typing import Final

import numpy as np

from pipeline.timing.clock_line import MAX_DRIFT, ClockLine, OffsetBound, TightestBounds, fit

WINDOW_S: Final = 60.0
"""How long a bound counts: quartz keeps its rate over it."""
BUCKET_S: Final = 1.0
"""Of each such span only its tightest bounds are kept."""
NEEDED: Final = 5
"""Answers before anything is dated, none of which says much more than those before: a quarter of
the error that they leave, and more than is slewed away unseen."""
UNSEEN_S: Final = 0.005
SURE_S: Final = 0.1
"""Bound of the error until which nothing is dated: a page that hangs while it begins answers late
and all at once, and what its first answers leave open would be slewed away for many seconds."""
LATEST_S: Final = 0.4
"""After the first answer what is known is taken as it is: the network is slow for good."""
CONTRADICTIONS: Final = 3
"""So many in a row: the clock jumped. Meanwhile nothing is dated."""
TOLERANCE_S: Final = 5e-4
"""A contradiction by less is noise of the stamps."""
SLEW_S, MAX_SLEW = 0.5, 0.02
"""What was learnt reaches `local` within this time, time never running faster or slower by more."""


class ClockSynchronisation:
    """Remote clock minus our clock."""

    def __init__(self) -> None:
        """Nothing known."""
        self._buckets: deque[TightestBounds] = deque()
        self._contradictions: list[tuple[float, float, float]] = []
        self._answers = 0
        """Since one said much more than those before."""
        self._widest = inf
        """Bound of the error at that one [s]."""
        self._is_sure = False
        self._trips: deque[tuple[float, float]] = deque()
        self._line: ClockLine | None = None
        self._mapping = ClockMapping()
        self._surest = (-inf, inf)
        """Question [ours] and stamp [theirs] of the answer that says most of later stamps."""
        self.restarts = 0
        """Times the clock had jumped."""
        self.reason = ""
        """Of the last restart, in words."""

    def add(self, t_asked: float, t_remote: float, t_answered: float) -> None:
        """Take an answer: asked and answered on our clock [s], stamped `t_remote` on theirs [s]."""
        if not (isfinite(t_asked + t_remote + t_answered) and t_asked <= t_answered):
            return
        line = self._line
        if line is None or not _contradicts(line, t_asked, t_remote, t_answered):
            self._contradictions.clear()
            self._take(t_asked, t_remote, t_answered)
            return
        self._contradictions.append((t_asked, t_remote, t_answered))
        if len(self._contradictions) >= CONTRADICTIONS:
            # all of them bound it: the last alone may have waited for long, one way
            lower, upper = np.array([_off(line, *one) for one in self._contradictions]).T
            jump = 0.5 * (lower.max() + upper.min())
            self._restart(f"The phone's clock jumped by {jump:+.2f} s.")

    @property
    def ready(self) -> bool:
        """Enough answers to trust it, and the last one doesn't contradict them."""
        return self._is_sure and not self._contradictions

    @property
    def offset(self) -> float:
        """Remote minus ours as `local` has it at the last answer [s].

        Raises:
            ValueError: before the first answer.
        """
        line = self._known()
        return self._mapping.offset(line.t)

    @property
    def drift(self) -> float:
        """How much faster the remote clock runs [s/s]. Raises ValueError before the first."""
        return self._known().drift

    @property
    def error(self) -> float:
        """Bound of the error of `offset` and of `local` at the last answer [s].

        By and large half the quickest round trip, for delays there and back may differ; as long
        as they don't, the error is a tenth of that. Raises ValueError before the first answer.
        """
        line, t = self._known(), self._trips[-1][0]
        unknown = 2.0 * MAX_DRIFT * (t - line.t)  # answers since then said nothing new
        return line.error + unknown + abs(line.at(t) - self._mapping.offset(t))

    @property
    def round_trip(self) -> float:
        """Shortest round trip of the window [s]."""
        self._known()
        return min(trip for _, trip in self._trips)

    def local(self, t_remote: float) -> float:
        """Our time at the remote time `t_remote` [s]: later for later, without steps."""
        self._known()
        return self._mapping.local(t_remote)

    def earliest(self, t_remote: float) -> float:
        """The earliest that our clock can have shown at the remote time `t_remote` [s].

        Whatever delays and drift are: an answer stamped before was stamped after its question, and
        their clock has run on since. Later for later; -inf for what was before the answer.
        """
        t_asked, t_stamped = self._surest
        since = t_remote - t_stamped
        return t_asked + since / (1.0 + MAX_DRIFT) if since >= 0.0 else -inf

    def _known(self) -> ClockLine:
        if self._line is None:
            raise ValueError("no answer yet")
        return self._line

    def _restart(self, reason: str) -> None:
        answers, self._contradictions = self._contradictions, []
        self._buckets.clear()
        self._trips.clear()
        self._answers, self._widest, self._is_sure = 0, inf, False
        self._line = None
        self._surest = (-inf, inf)
        self.restarts += 1
        self.reason = reason
        for answer in answers:
            self._take(*answer)

    def _take(self, t_asked: float, t_remote: float, t_answered: float) -> None:
        drift = self._line.drift if self._line is not None else 0.0
        lower = OffsetBound(t_answered, t_remote - t_answered)
        upper = OffsetBound(t_asked, t_remote - t_asked)
        is_news = self._remember(lower, upper, drift)
        if t_asked >= self.earliest(t_remote):
            self._surest = (t_asked, t_remote)
        self._trips.append((t_answered, t_answered - t_asked))
        while self._trips[0][0] < t_answered - WINDOW_S:
            self._trips.popleft()
        if is_news:
            self._line = self._refit(t_answered)
            self._mapping.steer(self._line, settled=self._is_sure)
        if not self._is_sure:
            self._is_sure = self._is_settled(t_answered - self._trips[0][0])

    def _is_settled(self, waited_s: float) -> bool:
        """Whether the next answers will hardly change the offset; asked at each answer."""
        error = self.error
        if error < min(0.75 * self._widest, self._widest - UNSEEN_S):
            self._answers, self._widest = 0, error
        self._answers += 1
        if waited_s >= LATEST_S:
            return len(self._trips) >= NEEDED
        return self._answers >= NEEDED and error <= SURE_S

    def _refit(self, t: float) -> ClockLine:
        """The line through what still agrees; a rate that has changed costs the older half."""
        line = fit(self._buckets, t)
        while len(self._buckets) > 1 and self._has_changed(line, t):
            for _ in range(len(self._buckets) // 2):
                self._buckets.popleft()
            line = fit(self._buckets, t)
        return line

    def _has_changed(self, line: ClockLine, t: float) -> bool:
        """The newest bounds leave much more room than all together: they follow another line."""
        if line.room < -TOLERANCE_S:
            return True
        if len(self._buckets) < 8 or t != self._buckets[-1].t:  # once a bucket is enough
            return False
        recent = fit(list(self._buckets)[-len(self._buckets) // 4 :], t).room
        return line.room < recent / 3.0 and line.room < recent - TOLERANCE_S

    def _remember(self, lower: OffsetBound, upper: OffsetBound, drift: float) -> bool:
        """Keep bounds tighter than those of the newest span; drop old spans."""
        t = lower.t
        while self._buckets and self._buckets[0].t < t - WINDOW_S:
            self._buckets.popleft()
        if not self._buckets or t >= self._buckets[-1].t + BUCKET_S:
            self._buckets.append(TightestBounds(t, lower, upper))
            return True
        bucket = self._buckets[-1]
        is_higher = lower.offset - bucket.lower.offset > drift * (lower.t - bucket.lower.t)
        is_lower = upper.offset - bucket.upper.offset < drift * (upper.t - bucket.upper.t)
        if is_higher:
            bucket.lower = lower
        if is_lower:
            bucket.upper = upper
        return is_higher or is_lower


class ClockMapping:
    """Remote time to ours: continuous, strictly increasing, and never changed for the past."""

    def __init__(self) -> None:
        """Nothing known."""
        self._t: list[float] = []
        """Knots on our clock [s], ascending; the last two are a plan that may change."""
        self._remote: list[float] = []
        self._drift = 0.0

    def steer(self, line: ClockLine, settled: bool) -> None:
        """From `line.t` on, approach `line` smoothly; at once if not yet `settled`."""
        offset = self.offset(line.t) if settled and self._t else line.offset
        keep = bisect_right(self._t, line.t - 1e-9) if settled else 0
        keep_from = max(0, keep - 64)
        self._t, self._remote = self._t[keep_from:keep], self._remote[keep_from:keep]
        takes = max(SLEW_S, abs(offset - line.offset) / MAX_SLEW)
        for t, theirs in ((line.t, offset), (line.t + takes, line.at(line.t + takes))):
            self._t.append(t)
            self._remote.append(t + theirs)
        self._drift = line.drift

    def offset(self, t: float) -> float:
        """Remote minus ours at our time `t` [s]."""
        return _interpolated(self._t, self._remote, t, 1.0 + self._drift) - t

    def local(self, t_remote: float) -> float:
        """Our time at `t_remote` [s]."""
        return _interpolated(self._remote, self._t, t_remote, 1.0 / (1.0 + self._drift))


def _off(
    line: ClockLine, t_asked: float, t_remote: float, t_answered: float
) -> tuple[float, float]:
    """Least and most by which the remote clock is ahead of `line`, if this answer is true [s]."""
    least = t_remote - t_answered - line.at(t_answered)
    return least, t_remote - t_asked - line.at(t_asked)


def _contradicts(line: ClockLine, t_asked: float, t_remote: float, t_answered: float) -> bool:
    """Whether `line` can't be right if this answer is."""
    error = line.error + MAX_DRIFT * (t_answered - line.t) + TOLERANCE_S
    least, most = _off(line, t_asked, t_remote, t_answered)
    return least > error or most < -error


def _interpolated(x: list[float], y: list[float], at: float, slope: float) -> float:
    """Straight between knots; `slope` before the first and beyond the last."""
    i = bisect_right(x, at)
    if i == 0:
        return y[0] + slope * (at - x[0])
    if i == len(x):
        return y[-1] + slope * (at - x[-1])
    return y[i - 1] + (y[i] - y[i - 1]) * (at - x[i - 1]) / (x[i] - x[i - 1])
