"""The witness of a flight sees who was away, and excuses what only the machine can have done."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from tests.e2e.flight_log import Flight, Said
from tests.e2e.witness import Hole, Steal, Witness, holes_of, longest

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
AWAY_S = 0.3


@pytest.fixture
def witness() -> Iterator[Witness]:
    one = Witness()
    yield one
    one.close()


def flight(mode: str, *holes: Hole) -> Flight:
    """Of ten seconds: TRACK for five, then that mode."""
    said = [Said(0.1 * n, "TRACK" if n < 50 else mode, "why", {}) for n in range(101)]
    return Flight(10.0, [], {"mode": mode, "reason": "why"}, said, list(holes))


def test_what_stops_a_ticker_is_noted_with_its_length(witness: Witness) -> None:
    began = time.monotonic()
    others = witness._processes[1].pid
    os.kill(others, signal.SIGSTOP)
    time.sleep(AWAY_S)
    os.kill(others, signal.SIGCONT)
    end = time.monotonic() + 5.0
    while longest(witness.holes(began), "others") < 0.9 * AWAY_S:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert longest(witness.holes(time.monotonic()), "others") == 0.0


def test_many_short_holes_of_the_machine_are_a_slow_machine() -> None:
    def ticks(away_s: float) -> Iterator[tuple[float, float]]:
        """A second on time, then away once in ten ticks."""
        for n in range(400):
            yield 0.005 * n, 0.005 + (away_s if n > 200 and n % 10 == 0 else 0.0)

    assert list(holes_of("machine", ticks(0.015))) == []
    assert {hole.where for hole in holes_of("machine", ticks(0.03))} == {"machine", "slow"}
    assert {hole.where for hole in holes_of("others", ticks(0.03))} == {"others"}
    assert flight("RAMP", Hole("slow", 4.8, 0.5)).excuse
    assert not flight("RAMP", *[Hole("machine", 4.8, 0.03)] * 9).excuse


def test_what_a_host_takes_from_one_processor_is_noted_and_a_fifth_is_an_excuse() -> None:
    steal, noted = Steal(), list[Hole]()
    for n in range(60):
        taken = 0.0 if n < 20 else min(0.04 * (n - 20), 0.12)
        noted += steal.look(0.1 * n, [0.001 * n, taken])
    assert {hole.where for hole in noted} == {"stolen"}
    assert max(hole.s for hole in noted) == pytest.approx(0.12)
    assert all(2.2 < hole.t < 2.9 for hole in noted)
    assert flight("RAMP", Hole("stolen", 4.8, 0.11)).excuse
    assert not flight("RAMP", Hole("stolen", 4.8, 0.09)).excuse
    assert not list(Steal().look(0.0, []))


def test_a_flight_is_excused_by_a_hole_longer_than_is_borne_where_it_ended() -> None:
    assert not flight("TRACK").ended
    assert flight("RAMP").ended == "why"
    assert flight("RAMP").following == pytest.approx(0.5)
    assert not flight("RAMP").excuse
    assert flight("RAMP", Hole("machine", 4.8, 0.08)).excuse
    assert flight("RAMP", Hole("others", 4.8, 1.2)).excuse
    assert not flight("RAMP", Hole("others", 4.8, 0.08)).excuse
    assert not flight("RAMP", Hole("machine", 2.0, 0.08)).excuse
    assert not flight("RAMP", Hole("page", 4.8, 2.0)).excuse  # it may be the page's own doing


def test_a_missed_bound_is_excused_by_such_a_hole_while_it_followed_and_by_nothing_else() -> None:
    def excuse(*holes: Hole) -> list[Hole]:
        return replace(flight("TRACK", *holes), missed="30 mm").excuse

    assert excuse(Hole("machine", 2.0, 0.08))
    assert not excuse(Hole("machine", 2.0, 0.05))
    assert not excuse(Hole("machine", -1.0, 0.08))
    assert not excuse(Hole("page", 2.0, 9.0))
    assert replace(flight("TRACK"), missed="30 mm").account().startswith("30 mm; followed")


@pytest.mark.parametrize("where", ["sensors", "lights"])
def test_a_played_phone_that_stood_still_is_told_of_and_no_excuse(where: str) -> None:
    ended = flight("RAMP", Hole(where, 4.8, 2.0))  # a page or a server that takes all does that
    assert not ended.excuse
    assert f"{where} away for 2000 ms" in ended.account()


def test_a_server_that_was_given_no_processor_is_an_excuse_and_one_at_work_is_not() -> None:
    flown = flight("RAMP")
    for n in range(49, 101):
        flown.said[n].server["armed_stall_ms"] = 1200.0
    assert not flown.excuse
    for n in range(49, 101):
        flown.said[n].server["armed_stall_waited_ms"] = 1190.0
    assert [(hole.where, hole.s) for hole in flown.excuse] == [("server", pytest.approx(1.19))]


def test_a_weak_machine_is_told_of_and_no_excuse() -> None:
    ended = replace(flight("RAMP"), slowness=2.7, spare=0.2)
    assert not ended.proofs
    assert "work takes 2.7 times as long" in ended.account()
    assert "20 % of the processors' time was left" in ended.account()


def test_a_weak_machine_without_a_processor_left_is_an_excuse_and_a_strong_one_is_not() -> None:
    asked_too_much = replace(flight("RAMP"), slowness=2.7, spare=0.04)
    (proof,) = asked_too_much.proofs
    assert "2.7 times as long" in proof
    assert "4 % was left" in proof
    assert not replace(asked_too_much, slowness=1.5).proofs
    assert not replace(asked_too_much, spare=float("nan")).proofs


def test_the_account_tells_modes_reasons_and_holes() -> None:
    told = flight("RAMP", Hole("page", 4.8, 0.12), Hole("machine", 4.7, 0.03)).account()
    assert "followed 50.0 %" in told
    assert "5.0 s RAMP: why" in told
    assert "4.8 s page away for 120 ms" in told
    assert "machine" not in told
