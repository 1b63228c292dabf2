"""What the machine did beside a flight: two tickers in processes of their own, and their holes.

One before everything else (SCHED_FIFO, where that is permitted): what it misses, nobody was given.
It also judges its own rate as control judges its own: many holes, each short, are a slow machine;
and reads what a virtual machine's host took from each processor, which who sleeps does not feel.
One like everybody else: what it misses though it asks for next to nothing, others took.

    python -m tests.e2e.witness machine|others [0.02]    # "where end [s] length [s]" of each hole
                                                         # that is longer
"""

from __future__ import annotations

import contextlib
import gc
import os
import re
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from server.control.tick_rate import OVER_S, TickRate
from tests.machine import own_s

PERIOD_S = 0.005
NOTED_S = 0.02
PRIORITY = 90
"""Above those of robot and control."""
WAYS = ("machine", "others")
STAT, PROCESSOR, STEAL = Path("/proc/stat"), re.compile(r"cpu\d+"), 8
"""Per processor, in 1/100 s: time in which it had work and its host did not run it (proc(5))."""
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
LOOK_S = 0.1
TAKEN_S = 0.1
"""Taken from one processor in `OVER_S`: a fifth, less is not noted."""


@dataclass(frozen=True, slots=True)
class Hole:
    """A while in which something did not run."""

    where: str
    """`machine`, `others`, `page`; `sensors` and `lights` of a played phone; `slow` for a while in
    which `machine` had many; `stolen`: in so much of the `OVER_S` before its end the host took the
    processor away that it took most from."""
    t: float
    """Its end [s, monotonic]."""
    s: float

    def __str__(self) -> str:
        return f"{self.where} {1e3 * self.s:.0f} ms at {self.t:.1f} s"


class Witness:
    """The two processes; they end with `close`, or when this one does."""

    def __init__(self, noted_s: float = NOTED_S) -> None:
        """Started, and ticking; no shorter hole is noted."""
        self._holes: list[Hole] = []
        self._processes = [_start(where, noted_s) for where in WAYS]
        self._threads = [
            threading.Thread(target=self._read, args=(process.stdout,), daemon=True)
            for process in self._processes
        ]
        for thread in self._threads:
            thread.start()

    def _read(self, lines: IO[str]) -> None:
        for line in lines:
            where, t, s = line.split()
            self._holes.append(Hole(where, float(t), float(s)))

    def holes(self, since: float = 0.0, longer_s: float = 0.0) -> list[Hole]:
        """Those that ended after `since` [s, monotonic]."""
        return [hole for hole in self._holes if hole.t >= since and hole.s >= longer_s]

    def close(self) -> None:
        """End them."""
        for process in self._processes:
            assert process.stdin is not None
            process.stdin.close()
            process.wait()
        for thread in self._threads:
            thread.join()
        for process in self._processes:
            assert process.stdout is not None
            process.stdout.close()


def longest(holes: Iterable[Hole], where: str) -> float:
    """Of one kind [s]; 0 without any."""
    return max((hole.s for hole in holes if hole.where == where), default=0.0)


def _start(where: str, noted_s: float) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "tests.e2e.witness", where, str(noted_s)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ticking\n"
    return process


def holes_of(
    where: str, steps: Iterable[tuple[float, float]], noted_s: float = NOTED_S
) -> Iterator[Hole]:
    """Holes of a ticker, by the time of each tick and the time since the one before it [s]."""
    rate = TickRate(PERIOD_S, longest_s=OVER_S)
    for now, step in steps:
        if step - PERIOD_S > noted_s:
            yield Hole(where, now, step - PERIOD_S)
        if rate.complaint(step) and where == "machine":
            yield Hole("slow", now, OVER_S)
            rate = TickRate(PERIOD_S, longest_s=OVER_S)


class Steal:
    """What the host takes from the processors. Sans-I/O."""

    def __init__(self) -> None:
        """Nothing looked at."""
        self._looks: deque[tuple[float, Sequence[float]]] = deque()

    def look(self, now: float, taken: Sequence[float]) -> Iterator[Hole]:
        """Take what was taken from each since the machine's start [s]; noted while it is much."""
        self._looks.append((now, taken))
        while now - self._looks[0][0] > OVER_S + 0.5 * LOOK_S:
            self._looks.popleft()
        _, before = self._looks[0]
        most = max((b - a for a, b in zip(before, taken, strict=False)), default=0.0)
        if most >= TAKEN_S:
            yield Hole("stolen", now, most)


def _taken() -> list[float]:
    """From each processor since the machine's start [s]; empty if nobody knows."""
    with contextlib.suppress(OSError):
        rows = [line.split() for line in STAT.read_text().splitlines()]
        return [own_s(TICK_S * int(row[STEAL])) for row in rows if PROCESSOR.fullmatch(row[0])]
    return []


def _look() -> None:
    steal = Steal()
    while True:
        time.sleep(LOOK_S)
        _say(steal.look(time.monotonic(), _taken()))


def _say(holes: Iterable[Hole]) -> None:
    for hole in holes:
        print(f"{hole.where} {hole.t:.4f} {hole.s:.4f}", flush=True)


def be_first(priority: int) -> None:
    """Run the calling thread before all that has no such priority, where that is permitted."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def _ticks() -> Iterator[tuple[float, float]]:
    before = time.monotonic()
    while True:
        time.sleep(PERIOD_S)
        now = time.monotonic()
        yield now, now - before
        before = now


def main() -> None:
    """Tick until the standard input is closed."""
    gc.disable()
    where = sys.argv[1]
    if where == "machine":
        be_first(PRIORITY)
        threading.Thread(target=_look, daemon=True).start()
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    print("ticking", flush=True)
    _say(holes_of(where, _ticks(), float(sys.argv[2]) if len(sys.argv) > 2 else NOTED_S))


if __name__ == "__main__":
    main()
