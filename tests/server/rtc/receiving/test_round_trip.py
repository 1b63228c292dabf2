"""The round trip of a line is that of now."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.rtc.receiving.round_trip import LONGEST_S, REMEMBERED, RoundTrip


def of(trips):
    trip = RoundTrip()
    for k, seconds in enumerate(trips):
        trip.add(float(k), k + seconds)
    return trip.seconds


@given(st.lists(st.floats(0.0, LONGEST_S - 0.01), min_size=1, max_size=60))
def test_most_of_the_last_answers_were_as_quick_and_some_as_slow(trips):
    last, found = trips[-REMEMBERED:], of(trips)
    assert sum(trip <= found + 1e-9 for trip in last) >= 0.75 * len(last)
    assert sum(trip >= found - 1e-9 for trip in last) >= 0.25 * len(last)


def test_a_line_that_gets_worse_is_noticed_within_a_second_of_answers():
    assert of([0.001] * 600 + [0.035] * REMEMBERED) == pytest.approx(0.035)
    assert of([0.001] * 600 + [0.035] * (REMEMBERED // 2)) == pytest.approx(0.035)


def test_one_slow_answer_is_not_believed():
    assert of([0.01] * 9 + [0.4]) == pytest.approx(0.01)


@pytest.mark.parametrize("seconds", [-0.1, LONGEST_S + 0.1, float("nan"), float("inf")])
def test_an_answer_that_cannot_be_is_left_out(seconds):
    assert of([0.01, seconds]) == pytest.approx(0.01)
    assert of([seconds]) is None
