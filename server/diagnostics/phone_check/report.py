"""A phone's check as one value: for a page, for a program, to keep."""

from __future__ import annotations

import msgspec

from server.diagnostics.phone_check.figures import PhoneFigures
from server.diagnostics.phone_check.measure import figures
from server.diagnostics.phone_check.page import page
from server.diagnostics.phone_check.phone_watch import PhoneSeries
from server.diagnostics.phone_check.verdicts import TITLES, CheckLine, verdicts, worst
from server.protocol.link_messages import Grade


class CheckReport(msgspec.Struct, frozen=True):
    """What `lightleash check --json` writes, and the page of a check keeps."""

    grade: Grade
    title: str
    """The verdict in words."""
    lines: list[CheckLine]
    figures: PhoneFigures
    """null: nothing tells."""


def report_of(found: PhoneFigures) -> CheckReport:
    """The verdict on what was found."""
    lines = verdicts(found)
    grade = worst(lines)
    return CheckReport(grade, TITLES[grade], lines, found)


def html_of(report: CheckReport) -> str:
    """A report as a page that stands by itself."""
    return str(page(report.figures, report.lines))


class CheckAnswer(msgspec.Struct, frozen=True):
    """Answer of `GET /api/check`."""

    report: CheckReport
    page: str
    """The same as HTML that stands by itself, to keep."""
    heard_s: float
    """So long this phone was there, of what was asked for."""


def answer_of(series: PhoneSeries) -> CheckAnswer:
    """What a page is told of a series."""
    report = report_of(figures(series))
    return CheckAnswer(report, html_of(report), series.heard_s)
