"""Does control keep its rate? Its words, and what it lets pass."""

from __future__ import annotations

from itertools import chain, repeat

import pytest

from server.control.tick_rate import OVER_S, TickRate

PERIOD_S, LONGEST_S = 0.005, 0.060


def complaints(*steps: float) -> list[str]:
    rate = TickRate(PERIOD_S, LONGEST_S)
    return [rate.complaint(step) for step in steps]


@pytest.mark.parametrize("rate_hz", [50, 25, 18, 15])
def test_a_slow_control_is_named_with_its_time_after_half_a_second(rate_hz: int) -> None:
    step = 1.0 / rate_hz
    said = complaints(*repeat(step, 2 * rate_hz))
    first = next(k for k, words in enumerate(said) if words)
    assert OVER_S <= (first + 1) * min(step, LONGEST_S) < OVER_S + step
    assert all(said[first:])
    assert said[-1] == (
        f"Control runs slowly: {1e3 * min(step, LONGEST_S):.0f} ms from tick to tick instead of 5."
    )


def test_a_machine_that_misses_a_fifth_of_its_ticks_and_one_long_hole_is_not_slow() -> None:
    busy = chain.from_iterable(repeat((0.005, 0.005, 0.005, 0.010), 100))
    assert not any(complaints(*busy, 0.4, *repeat(0.005, 200)))


def test_the_limit_is_half_as_slow_again() -> None:
    assert not any(complaints(*repeat(0.0074, 200)))
    assert any(complaints(*repeat(0.0076, 200)))


def test_it_forgets_when_the_rate_is_back() -> None:
    said = complaints(*repeat(0.02, 50), *repeat(0.005, 200))
    assert any(said[:50])
    assert not any(said[160:])


def test_before_the_first_step_nothing_is_known() -> None:
    assert complaints(-float("inf"), float("nan")) == ["", ""]
