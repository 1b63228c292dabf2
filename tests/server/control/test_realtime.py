"""Schedule: 200 Hz on an absolute schedule, in virtual time."""

from __future__ import annotations

import gc
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.control import realtime
from server.control.realtime import Schedule

PERIOD = 0.005


class Clock:
    """Time that passes only when somebody sleeps or works."""

    def __init__(self) -> None:
        self.t = 1000.0
        self.oversleeps = 0.0

    def now(self) -> float:
        return self.t

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.t += seconds + self.oversleeps


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(realtime, "time", made)
    monkeypatch.setattr(realtime, "clock", made)
    return made


def test_oversleeping_does_not_add_up(clock):
    clock.oversleeps = 0.001
    schedule = Schedule(PERIOD)
    ticks = [schedule.wait() for _ in range(1000)]
    np.testing.assert_allclose(np.diff(ticks), PERIOD, atol=1e-9)
    late = schedule.lateness_ms()
    assert late == {"p50": 1.0, "p99": 1.0, "p999": 1.0, "max": 1.0, "missed": 0.0}


def test_work_that_takes_too_long_costs_whole_ticks_which_are_counted(clock):
    schedule = Schedule(PERIOD)
    first = schedule.wait()
    clock.t += 0.0123
    second = schedule.wait()
    assert second == pytest.approx(first + 0.0123)
    assert schedule.missed == 1
    assert schedule.wait() == pytest.approx(first + 0.015)
    assert schedule.lateness_ms()["max"] == pytest.approx(7.3)


def test_nothing_is_known_before_the_first_tick(clock):
    assert Schedule(PERIOD).lateness_ms() == {}


def test_old_lateness_is_forgotten_missed_ticks_are_not(clock):
    schedule = Schedule(PERIOD, window=100)
    schedule.wait()
    clock.t += 0.1
    for _ in range(101):
        schedule.wait()
    late = schedule.lateness_ms()
    assert late["max"] == 0.0
    assert late["missed"] == 19.0


def test_after_the_slowest_tick_the_schedule_goes_on_where_it_would_be():
    @given(st.lists(st.floats(0.0, 0.08), min_size=1, max_size=50))
    def law(works):
        clock = Clock()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(realtime, "time", clock)
            patch.setattr(realtime, "clock", clock)
            schedule, start = Schedule(PERIOD), clock.t
            for work in works:
                now = schedule.wait()
                late = schedule._lateness[(schedule.ticks - 1)]
                assert now - late == pytest.approx(
                    start + round((now - late - start) / PERIOD) * PERIOD
                )
                clock.t += work
            elapsed = round((schedule._next - start) / PERIOD) - 1
            assert schedule.ticks + schedule.missed == elapsed

    law()


def test_it_says_what_was_granted_or_how_to_get_it(monkeypatch):
    for name in ("collect", "freeze", "disable"):
        monkeypatch.setattr(gc, name, lambda: None)

    def denied(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", denied)
    assert "CAP_SYS_NICE" in realtime.claim()
