"""Stalls of the event loop: measured by a ticker in it, kept for a minute, said while armed."""

from __future__ import annotations

import asyncio
from contextlib import closing

import pytest

from server.diagnostics.pauses import LOOK_S, WINDOW_S, LoopWatch, Pauses, RunQueue, Stall


class Clock:
    def __init__(self) -> None:
        self.t = 100.0

    def __call__(self) -> float:
        return self.t


def watched(pauses: Pauses, work: list[float], clock: Clock, cpu: Clock) -> None:
    """Let the loop be busy for some times [s], one after the other."""

    async def scene() -> None:
        watching = asyncio.create_task(pauses.watch())
        for seconds in work:
            await asyncio.sleep(0.0)
            clock.t += seconds
            cpu.t += 0.5 * seconds
            await asyncio.sleep(2.0 * LOOK_S)
        watching.cancel()

    asyncio.run(scene())


def test_the_longest_stall_of_the_last_minute_is_told() -> None:
    watch = LoopWatch()
    for t, late in ((0.0, 0.01), (1.0, 0.09), (2.0, 0.03), (50.0, 0.02)):
        watch.add_stall(t, Stall(late), armed=False)
    assert watch.lately(50.0).late_s == 0.09
    assert watch.lately(1.5 + WINDOW_S).late_s == 0.03
    assert watch.lately(2.5 + WINDOW_S).late_s == 0.02
    assert watch.lately(50.5 + WINDOW_S).late_s == 0.0
    assert watch.armed == Stall()


def test_what_keeps_the_loop_is_measured_with_its_processor_time() -> None:
    clock, cpu = Clock(), Clock()
    pauses = Pauses(clock, cpu, lambda: 0.0, waited=lambda: 0.25 * clock())
    pauses.tick(armed=True, idle=False)
    watched(pauses, [0.015, 0.205, 0.105], clock, cpu)
    figures = pauses.figures()
    assert figures["stall_ms"] == figures["armed_stall_ms"] == pytest.approx(200.0)
    assert figures["armed_stall_cpu_ms"] == pytest.approx(102.5)
    assert figures["armed_stall_waited_ms"] == pytest.approx(51.2, abs=0.1)


def test_each_status_tells_of_the_longest_stall_since_the_one_before() -> None:
    clock = Clock()
    pauses = Pauses(clock, lambda: 0.0, lambda: 0.0)

    def told(*stalls: float) -> list[float]:
        """In a status, which is made before the tick; a second look changes nothing."""
        for seconds in stalls:
            clock.t += 0.01
            pauses.loop.add_stall(
                clock(), Stall(seconds, 0.5 * seconds, 0.25 * seconds), armed=True
            )
        figures = pauses.figures()
        assert pauses.figures() == figures
        pauses.tick(armed=True, idle=False)
        return [value for name, value in figures.items() if name.startswith("recent_stall")]

    assert told(0.3, 0.01) == [300.0, 150.0, 75.0, 100_010.0]
    assert told(0.03, 0.04, 0.02) == [40.0, 20.0, 10.0, 100_040.0]
    assert told()[:3] == [0.0, 0.0, 0.0]
    assert pauses.figures()["armed_stall_ms"] == 40.0


def test_waiting_for_a_processor_is_counted_where_the_system_tells() -> None:
    with closing(RunQueue()) as waited:
        assert 0.0 <= waited() <= waited() < 1e6


def test_stalls_are_said_while_armed_the_longest_and_not_all_the_time() -> None:
    clock = Clock()
    pauses = Pauses(clock, lambda: 0.0, lambda: 0.0)

    def stall(seconds: float) -> str:
        pauses.loop.add_stall(clock(), Stall(seconds, 0.5 * seconds, 0.25 * seconds), armed=True)
        return pauses.tick(armed=True, idle=False)

    assert pauses.tick(armed=True, idle=False) == ""
    assert stall(0.019) == ""
    assert stall(0.041) == (
        "The server stood still for 41 ms while armed: 20 ms at work, 10 ms without a processor."
    )
    assert stall(0.3) == ""
    clock.t += 11.0
    assert "300 ms" in pauses.tick(armed=True, idle=False)
    clock.t += 11.0
    assert stall(0.25) == ""
    assert pauses.tick(armed=False, idle=False) == ""
    assert pauses.figures()["armed_stall_ms"] == 300.0
    assert pauses.tick(armed=True, idle=False) == ""
    assert pauses.figures()["armed_stall_ms"] == 0.0
