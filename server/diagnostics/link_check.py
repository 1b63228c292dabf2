"""What it will be like to fly with a phone's link, from what came of it when. Pure functions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from msgspec.structs import replace

from pipeline.config import FailsafeConfig
from server.diagnostics.link_log import Arrival, Series
from server.diagnostics.link_words import advice, lines, title
from server.protocol.link_messages import SIDES, Grade, LinkReport, Side

GAPS_MS = (60, 100, 150, 250, 400, 1000)
LEAST_S = 5.0
"""Nothing is said of less."""
GOOD_SHARE, FAIR_SHARE = 0.99, 0.95
"""Of the time in which the robot follows."""
PRESS_S = 1.5
"""What it costs to notice that the robot has stopped, let go, and press again."""
ENOUGH_PICTURES_S = 0.5
SHORTEST_BUSY_S = 0.1
"""Within a shorter silence no picture need come, so it does not show whether the page was busy."""

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Wait:
    """The robot would not follow from `begin` to `end` [s]."""

    begin: float
    end: float
    longest: Span
    """Of the silences that it consists of."""


def check(series: Series, rules: FailsafeConfig) -> LinkReport:
    """The verdict on a series."""
    seconds = max(series.end - series.begin, 1e-9)
    waits = _waits(series, rules)
    ends = [wait for wait in waits if _length(wait.longest) > rules.gap]
    trips = sorted(came - asked for asked, came in series.answers)
    answered = {asked for asked, _ in series.answers}
    due = [asked for asked in series.asked if asked < series.end - rules.gap]
    report = LinkReport(
        grade="unknown",
        title="",
        lines=[],
        advice=[],
        seconds=round(seconds, 1),
        follows=round(1.0 - sum(wait.end - wait.begin for wait in waits) / seconds, 4),
        waits=len(waits) - len(ends),
        ends=len(ends),
        sides={side: sum(side == _side(wait.longest, series) for wait in waits) for side in SIDES},
        gaps={str(ms): sum(1e3 * _length(span) > ms for span in _gaps(series)) for ms in GAPS_MS},
        longest_ms=round(1e3 * max(map(_length, _gaps(series)), default=0.0), 1),
        rtt_ms=_ms(_quantile(trips, 0.5)),
        rtt_p95_ms=_ms(_quantile(trips, 0.95)),
        lost=round(sum(asked not in answered for asked in due) / max(1, len(due)), 3),
        motion_hz=round(len(series.motion) / seconds, 1),
        picture_hz=round(len(series.pictures) / seconds, 1),
        picture_age_ms=_ms(_quantile(sorted(came - t for t, came in series.pictures), 0.5)),
        picture_gap_ms=_ms(_longest_wait(series.pictures, series)),
    )
    report = replace(report, grade=_grade(report, series))
    return replace(report, title=title(report), lines=lines(report), advice=advice(report))


def _grade(report: LinkReport, series: Series) -> Grade:
    if report.seconds < LEAST_S or not series.answers:
        return "unknown"
    if report.ends or report.follows < FAIR_SHARE or not (series.motion and series.pictures):
        return "poor"
    pictures = report.picture_gap_ms is not None and report.picture_gap_ms < 1e3 * ENOUGH_PICTURES_S
    return "good" if report.follows >= GOOD_SHARE and pictures else "fair"


def _gaps(series: Series) -> list[Span]:
    """Gaps between signs of life, as they came."""
    times = [series.begin, *(came for _, came in series.answers), series.end]
    return list(pairwise(times))


def _ages(arrivals: Sequence[Arrival], series: Series) -> list[Span]:
    """Each until a newer one came; what comes out of order is no news."""
    spans: list[Span] = []
    newest = series.begin
    for t, came in arrivals:
        if t > newest:
            spans.append((newest, came))
            newest = t
    return [*spans, (newest, series.end)]


def _waits(series: Series, rules: FailsafeConfig) -> list[_Wait]:
    """When the robot would not follow: silences of page or motion that run into each other."""
    silences = [*_ages(series.answers, series), *_ages(series.motion, series)]
    waits: list[_Wait] = []
    for silence in sorted(span for span in silences if _length(span) > rules.silent):
        back = PRESS_S if _length(silence) > rules.gap else rules.fresh
        wait = _Wait(silence[0] + rules.silent, min(silence[1] + back, series.end), silence)
        if waits and wait.begin <= waits[-1].end:
            before = waits.pop()
            longest = max(before.longest, silence, key=_length)
            wait = _Wait(before.begin, max(before.end, wait.end), longest)
        waits.append(wait)
    return waits


def _side(silence: Span, series: Series) -> Side:
    """Side of a gap: the server asked nobody, or pictures came on while the page was silent."""
    begin, end = silence
    asked = [begin, *(t for t in series.asked if begin < t < end), end]
    if max(map(_length, pairwise(asked))) > 0.5 * (end - begin):
        return "server"
    pictures = [begin, *(came for _, came in series.pictures if begin < came < end), end]
    if end - begin > SHORTEST_BUSY_S and max(map(_length, pairwise(pictures))) < 0.5 * (
        end - begin
    ):
        return "phone"
    return "link"


def _longest_wait(arrivals: Iterable[Arrival], series: Series) -> float | None:
    times = [series.begin, *(came for _, came in arrivals), series.end]
    return max(map(_length, pairwise(times))) if len(times) > 2 else None


def _length(span: Span) -> float:
    return span[1] - span[0]


def _quantile(values: Sequence[float], share: float) -> float | None:
    return values[min(len(values) - 1, int(share * len(values)))] if values else None


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1e3 * seconds, 1)
