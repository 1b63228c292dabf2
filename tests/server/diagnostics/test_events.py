"""Events: whatever pages do, what others have to say is shown, and what is left out is counted."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from server.diagnostics.events import (
    EVENTS,
    LINES_AT_ONCE,
    LINES_HZ,
    MAX_KINDS,
    MOST_OF_PAGES,
    Events,
)
from server.protocol.messages import LoggedEvent

PAGES = ["page of Anna", "page of Bert", "Anna: arm"]


@given(
    st.lists(
        st.tuples(st.sampled_from(["", *PAGES]), st.floats(0.0, 8.0), st.booleans()), max_size=150
    )
)
def test_every_line_is_shown_or_counted_and_pages_push_out_nobody_elses(said):
    events, t, own, of_pages, told = Events(), 0.0, [], dict.fromkeys(PAGES, 0), []
    for n, (of, wait, ticks) in enumerate(said):
        t += wait
        if ticks:
            told += events.count_up(t)
        shown = events.add(f"line {n}", t, of)
        if of:
            of_pages[of] += 1
        else:
            own.insert(0, shown)
        told += [shown] if of and shown else []
        kept = [event.text for event in events.shown if event.text in own]
        assert kept == own[: len(kept)]
        assert len(kept) >= min(len(own), EVENTS - MOST_OF_PAGES)
        assert len(events.shown) - len(kept) <= MOST_OF_PAGES
    left_out = sum(int(n) for text in told for n in re.findall(r"(\d+) lines left out", text))
    pending = sum(events._left_out.values())
    shown_lines = sum("line " in text for text in told)
    assert shown_lines + left_out + pending == sum(of_pages.values())


def test_one_page_gets_no_more_lines_than_its_rate_and_is_counted_once_it_is_silent():
    events = Events()
    lines = [events.add("x", 0.01 * tick, "page of Anna") for tick in range(1000)]
    shown = sum(map(bool, lines))
    assert LINES_AT_ONCE <= shown <= LINES_AT_ONCE + 10.0 * LINES_HZ
    counted = [int(n) for text in lines for n in re.findall(r"\((\d+) lines", text)]
    assert events.add("y", 10.0, "page of Bert") == "y"
    (last,) = events.count_up(20.0)
    assert last == f"page of Anna: {1000 - shown - sum(counted)} lines left out"
    assert events.count_up(40.0) == []


def test_what_is_remembered_is_bounded():
    events = Events()
    for n in range(3 * MAX_KINDS):
        for _ in range(int(LINES_AT_ONCE) + 1):
            events.add("x", 0.0, f"page of {n}")
    assert len(events._kinds) == len(events._left_out) == MAX_KINDS


def test_what_happens_again_is_one_line_with_how_often_and_when_last():
    events = Events(unix_zero_s=1_000.0)
    for t in (1.0, 2.0, 3.5):
        events.add("COAST: silent", t)
        events.add("TRACK: follows", t + 0.25)
    assert list(events.shown) == [
        LoggedEvent("TRACK: follows", 1_003_750, times=3),
        LoggedEvent("COAST: silent", 1_003_500, times=3),
    ]


def test_a_page_that_repeats_itself_takes_one_place():
    events = Events()
    events.add("own", 0.0)
    for n in range(MOST_OF_PAGES):
        events.add(f"page {n}", 0.0, f"page of {n}")
    for t in range(20):
        events.add("page 0", 10.0 * t, "page of 0")
    texts = [event.text for event in events.shown]
    assert texts == ["page 0", *(f"page {n}" for n in reversed(range(1, MOST_OF_PAGES))), "own"]
