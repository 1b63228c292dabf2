"""A link's figures say what it will be like to fly with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.config import FailsafeConfig
from server.diagnostics.link_check import check
from server.diagnostics.link_log import KEPT_S, LinkLog, Series

RULES = FailsafeConfig()
PING_S, RTT_S = 1.0 / 60.0, 0.012


def fine(seconds=60.0, rtt=RTT_S):
    """A link on which nothing is ever late."""
    asked = np.arange(0.0, seconds, PING_S)
    pictures = np.arange(0.0, seconds, 1.0 / 30.0)
    motion = np.arange(0.0, seconds, 1.0 / 60.0)
    return Series(
        0.0,
        seconds,
        tuple(asked.tolist()),
        _arrivals(asked, asked + rtt, seconds),
        _arrivals(motion, motion + 0.5 * rtt, seconds),
        _arrivals(pictures, pictures + 0.08, seconds),
    )


def _arrivals(made, came, seconds):
    pairs = zip(made.tolist(), came.tolist(), strict=True)
    return tuple((t, c) for t, c in pairs if c <= seconds)


def without(arrivals, begin, end):
    """What would have come meanwhile is lost."""
    return tuple(a for a in arrivals if not begin < a[1] < end)


def silent(series, begin, length, kinds=("answers", "motion", "pictures")):
    return replace(series, **{k: without(getattr(series, k), begin, begin + length) for k in kinds})


def test_a_link_without_a_gap_is_good_and_nothing_need_be_done():
    report = check(fine(), RULES)
    assert (report.grade, report.follows, report.waits, report.ends) == ("good", 1.0, 0, 0)
    assert set(report.gaps.values()) == {0}
    assert report.advice == []
    assert report.rtt_ms == pytest.approx(1e3 * RTT_S, abs=0.2)
    assert report.picture_hz == pytest.approx(30.0, rel=0.02)
    assert report.lost == 0.0


@pytest.mark.parametrize(
    ("length", "waits", "ends"), [(0.09, 0, 0), (0.25, 1, 0), (0.4, 1, 0), (0.9, 1, 0), (1.2, 0, 1)]
)
def test_a_silence_is_borne_or_waited_for_or_ends_a_flight(length, waits, ends):
    report = check(silent(fine(), 20.0, length), RULES)
    assert (report.waits, report.ends) == (waits, ends)
    assert report.sides == {"link": waits + ends, "phone": 0, "server": 0}
    assert (report.grade == "poor") == (ends > 0)
    assert report.longest_ms == pytest.approx(1e3 * length, abs=2e3 * PING_S)


def test_a_gap_costs_what_is_beyond_the_silence_that_is_borne_and_the_way_back():
    length = 0.4
    report = check(silent(fine(), 20.0, length), RULES)
    lost = (1.0 - report.follows) * 60.0
    assert lost == pytest.approx(length + RTT_S - RULES.silent + RULES.fresh, abs=2 * PING_S)


@settings(max_examples=60, deadline=None)
@given(
    begin=st.floats(1.0, 25.0),
    length=st.floats(0.0, 3.0),
    more=st.floats(0.0, 2.0),
    rtt=st.floats(0.001, 0.1),
)
def test_a_longer_silence_never_makes_a_link_better(begin, length, more, rtt):
    series = fine(30.0, rtt)
    short = check(silent(series, begin, length), RULES)
    long = check(silent(series, begin, length + more), RULES)
    assert long.follows <= short.follows + 1e-9
    assert all(long.gaps[ms] >= short.gaps[ms] for ms in ("400", "1000"))
    grades = ["good", "fair", "poor"]
    assert grades.index(long.grade) >= grades.index(short.grade)
    assert 0.0 <= long.follows <= 1.0


def test_a_computer_that_asks_nobody_is_not_a_phone_that_does_not_answer():
    series = silent(fine(), 20.0, 0.3)
    busy = replace(series, asked=tuple(t for t in series.asked if not 19.99 < t < 20.29))
    assert check(busy, RULES).sides == {"link": 0, "phone": 0, "server": 1}
    assert any("server's computer" in line for line in check(busy, RULES).lines)


def test_a_page_that_hangs_while_its_pictures_come_is_not_a_bad_link():
    report = check(silent(fine(), 20.0, 0.3, ("answers", "motion")), RULES)
    assert report.sides == {"link": 0, "phone": 1, "server": 0}
    assert any("other apps" in step for step in report.advice)


def test_motion_that_does_not_come_keeps_the_robot_from_following_too():
    assert check(silent(fine(), 20.0, 6.0, ("motion",)), RULES).grade == "poor"
    deaf = check(replace(fine(), motion=()), RULES)
    assert deaf.grade == "poor"
    assert "No motion samples came." in deaf.lines


def test_pictures_that_come_seldom_are_no_good_and_none_are_worse():
    seldom = check(silent(fine(), 20.0, 0.7, ("pictures",)), RULES)
    assert (seldom.grade, seldom.waits) == ("fair", 0)
    assert "wait now and then" not in seldom.title
    blind = check(replace(fine(), pictures=()), RULES)
    assert blind.grade == "poor"
    assert "No pictures came." in blind.lines


def test_without_enough_to_go_by_nothing_is_promised():
    assert check(fine(3.0), RULES).grade == "unknown"
    nobody = check(Series(0.0, 60.0), RULES)
    assert (nobody.grade, nobody.lines, nobody.rtt_ms) == ("unknown", [], None)
    assert nobody.advice


def test_a_slow_link_and_a_sleepy_radio_are_told_what_helps():
    slow = check(fine(rtt=0.14), RULES)
    assert any("5 GHz" in step for step in slow.advice)
    assert slow.grade == "poor"  # each answer is as old as is borne
    asked = fine().asked
    sleepy = tuple((t, t + (0.1 if k % 8 == 0 else RTT_S)) for k, t in enumerate(asked))
    report = check(replace(fine(), answers=tuple(sorted(sleepy, key=lambda a: a[1]))), RULES)
    assert any("awake" in step for step in report.advice)


def test_answers_that_are_all_late_are_one_wait_not_one_for_each():
    report = check(fine(rtt=0.2), RULES)
    assert (report.waits, report.ends) == (1, 0)
    assert report.follows < 0.05
    assert any("mostly wait" in line for line in report.lines)
    twice = silent(silent(fine(), 20.0, 0.3), 30.0, 0.3)
    assert check(twice, RULES).waits == 2


def test_only_the_last_minute_is_remembered_and_no_more_than_there_was():
    log = LinkLog(0.0)
    for k in range(10_000):
        log.asked(0.01 * k)
        log.came("answers", 0.01 * k, 0.01 * k + 0.005)
    assert log.series(100.0, 10.0).begin == 90.0
    assert log.series(100.0, 1e9).begin == 100.0 - KEPT_S
    assert len(log.series(100.0, 10.0).asked) == 1000
    assert LinkLog(95.0).series(100.0, 60.0).begin == 95.0
