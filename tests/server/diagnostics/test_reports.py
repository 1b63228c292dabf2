"""Verdicts on the link: one at a time, off the event loop, and not for each who asks."""

from __future__ import annotations

import asyncio
import threading

import pytest

from pipeline.config import FailsafeConfig
from server.diagnostics.link_check import check
from server.diagnostics.link_log import LinkLog
from server.diagnostics.reports import LASTS_S, MAX_KEPT, Reports


class Judge:
    """Counts what is computed, and where."""

    def __init__(self, runner):
        self.runner = runner
        self.t, self.judged, self.threads, self.at_once = 100.0, 0, set(), 0
        self.reports = Reports(lambda: self.t, self)
        self.log = LinkLog(0.0)

    def __call__(self, series):
        self.at_once += 1
        assert self.at_once == 1
        self.judged += 1
        self.threads.add(threading.get_ident())
        report = check(series, FailsafeConfig())
        self.at_once -= 1
        return report

    def ask(self, *seconds):
        async def all_at_once():
            return await asyncio.gather(*(self.reports.of(self.log, s) for s in seconds))

        return self.runner.run(all_at_once())


@pytest.fixture
def runner():
    with asyncio.Runner() as one:
        yield one


def test_many_who_ask_the_same_cost_one_computation_a_second_and_none_on_the_event_loop(runner):
    judge = Judge(runner)
    for tick in range(50):
        judge.t = 100.0 + 0.1 * tick
        reports = judge.ask(*[60.0] * 20)
        assert reports == [reports[0]] * 20
    assert judge.judged == 5.0 / LASTS_S
    assert threading.get_ident() not in judge.threads


def test_who_asks_for_other_seconds_is_told_of_those_one_after_the_other(runner):
    judge = Judge(runner)
    assert [report.seconds for report in judge.ask(10.0, 20.0, 30.0)] == [10.0, 20.0, 30.0]
    assert judge.judged == 3


def test_another_phone_is_another_link(runner):
    judge = Judge(runner)
    judge.ask(10.0)
    judge.log = LinkLog(95.0)
    assert [report.seconds for report in judge.ask(10.0)] == [5.0]


def test_what_is_kept_is_bounded(runner):
    judge = Judge(runner)
    judge.ask(*(0.5 + n for n in range(3 * MAX_KEPT)))
    assert len(judge.reports._kept) == MAX_KEPT
