"""Latest and Meter: newest wins, losses count."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.latest import WINDOW_S, Latest, Meter


@given(st.lists(st.one_of(st.integers(), st.none()), max_size=50))
def test_each_value_is_taken_or_counted_as_dropped(script: list[int | None]) -> None:
    slot: Latest[int] = Latest()
    put, taken = 0, 0
    for step in script:  # None: take
        if step is None:
            taken += slot.take() is not None
        else:
            slot.put(step)
            put += 1
            assert slot.peek() == step
    assert put == taken + slot.dropped + (slot.peek() is not None)


def test_threads_lose_nothing_uncounted() -> None:
    slot: Latest[int] = Latest()
    taken: list[int] = []
    done = threading.Event()

    def reader() -> None:
        while not done.is_set() or slot.peek() is not None:
            value = slot.take()
            if value is not None:
                taken.append(value)

    thread = threading.Thread(target=reader)
    thread.start()
    for k in range(20_000):
        slot.put(k)
    done.set()
    thread.join()
    assert taken == sorted(set(taken))
    assert taken[-1] == 19_999
    assert len(taken) + slot.dropped == 20_000


def test_a_meter_tells_rate_and_age_and_knows_nothing_before_the_first() -> None:
    meter = Meter()
    assert meter.stream(5.0).age_ms is None
    assert meter.age(5.0) == float("inf")
    for k in range(400):
        meter.tick(0.01 * k, 0.01 * k - 0.05)
    stream = meter.stream(4.0)
    assert stream.rate_hz == pytest.approx(100.0, rel=0.02)
    assert stream.age_ms == pytest.approx(60.0, abs=0.2)
    assert meter.stream(4.0 + 2.0 * WINDOW_S).rate_hz == 0.0


def test_an_old_item_makes_a_stream_no_younger() -> None:
    meter = Meter()
    meter.tick(10.0, 9.9)
    meter.tick(10.1, 3.0)
    assert meter.age(10.1) == pytest.approx(0.2)
