"""Whether this computer has a processor to spare, and if not, who takes them; Linux alone tells."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.common.clock import now
from server.diagnostics.pauses import RunQueue

PROC: Final = Path("/proc")
LOOK_S = 2.0
"""From one look to the next: long enough that a burst is none, short enough to explain a RAMP."""
IDLE_SHARE, WAITED_SHARE = 0.05, 0.2
"""With less of the processors idle, or with the server's loop waiting for one for a larger share of
the time, this computer is busy: it explains what comes late, it refuses nothing by itself."""
TELLING_SHARE = 0.25
"""Of one processor: who takes less is not worth naming."""
IS_BUSY = "The server's computer is too busy."
CHARGER = "a laptop wants its charger"
ADVICE = f"Close other programs on it; {CHARGER}."
OWN = "Lightleash itself"


@dataclass(frozen=True, slots=True)
class Process:
    """One, as the system tells of it."""

    name: str
    parent: int
    taken: int
    """Processor time so far [ticks]."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What the system told at one time."""

    t: float
    total: int
    """Of all processors together [ticks]."""
    idle: int
    processes: Mapping[int, Process]
    """Empty: not asked for."""


def look(t: float, proc: Path = PROC, *, by_process: bool = True) -> Look:
    """Read it. Raises OSError where nothing is told."""
    with (proc / "stat").open(encoding="ascii") as file:
        times = [int(word) for word in file.readline().split()[1:9]]  # guests are in user and nice
    processes = {}
    for folder in proc.iterdir() if by_process else ():
        if folder.name.isdigit():
            with contextlib.suppress(OSError):  # it has ended
                processes[int(folder.name)] = _process(
                    (folder / "stat").read_text("utf-8", "replace")
                )
    return Look(t, sum(times), times[3] + times[4], processes)


def _process(text: str) -> Process:
    """Of a line of its `stat`; a name may have spaces and brackets."""
    begin, end = text.index("("), text.rindex(")")
    words = text[end + 2 :].split()
    return Process(text[begin + 1 : end], int(words[1]), int(words[11]) + int(words[12]))


def idle_share(before: Look, after: Look) -> float:
    """Share of the processors that nobody wanted between two looks; 1 if no time has passed."""
    passed = after.total - before.total
    return (after.idle - before.idle) / passed if passed > 0 else 1.0


def takers(before: Look, after: Look, own: int, processors: int) -> list[tuple[str, float]]:
    """Who took how many processors, the largest first; `own` began all that belongs to us."""
    passed = after.total - before.total
    by_name: dict[str, int] = {}
    for pid, process in after.processes.items():
        former = before.processes.get(pid)
        name = OWN if _is_of(pid, own, after.processes) else process.name
        taken = process.taken - (former.taken if former is not None else 0)
        by_name[name] = by_name.get(name, 0) + taken
    shares = [(name, taken / passed * processors) for name, taken in by_name.items()]
    return sorted(shares, key=lambda one: -one[1]) if passed > 0 else []


def _is_of(pid: int, own: int, processes: Mapping[int, Process]) -> bool:
    seen = set()
    while pid != own and pid in processes and pid not in seen:
        seen.add(pid)
        pid = processes[pid].parent
    return pid == own


def advice(taking: list[tuple[str, float]]) -> str:
    """What to do about a busy computer, with who takes the most of it, if anybody takes much."""
    if not taking or taking[0][1] < TELLING_SHARE:
        return ADVICE
    name, _ = taking[0]
    if name == OWN:
        return f"{OWN} takes the most: close 3D views and other programs; {CHARGER}."
    return f"{name} takes the most of it: close what is not needed; {CHARGER}."


class Load:
    """Looks now and then, and remembers what to say."""

    def __init__(self, proc: Path = PROC, own: int | None = None) -> None:
        """`own` began all that belongs to us: by default this process' parent, the launcher."""
        launcher = os.getppid() if os.getppid() > 1 else os.getpid()  # 1 is everybody's
        self._proc, self._own = proc, launcher if own is None else own
        self._processors = os.cpu_count() or 1
        self._before: Look | None = None
        self.is_busy = False
        self.advice = ADVICE
        """What to do about it, of the last look at which it was busy."""

    @property
    def words(self) -> str:
        """That it is too busy, and what to do; "" if it is not."""
        return f"{IS_BUSY} {self.advice}" if self.is_busy else ""

    async def watch(self) -> None:
        """Look until cancelled, from the loop whose waiting counts; end where nothing is told."""
        with contextlib.closing(RunQueue()) as waited, contextlib.suppress(OSError):
            t, before = now(), waited()
            while True:
                # a machine of a thousand processes is read through only while it is busy
                seen = await asyncio.to_thread(look, now(), self._proc, by_process=self.is_busy)
                t_now, after = now(), waited()
                share = (after - before) / (t_now - t) if t_now > t else 0.0
                self.take(seen, share)
                t, before = t_now, after
                await asyncio.sleep(LOOK_S)

    def take(self, seen: Look, waited_share: float) -> None:
        """Judge by another look, and by how long our own loop has waited since the one before."""
        former, self._before = self._before, seen
        if former is None:
            return
        idle = idle_share(former, seen)
        self.is_busy = idle < IDLE_SHARE or waited_share > WAITED_SHARE
        if self.is_busy:
            is_known = former.processes and seen.processes
            taking = takers(former, seen, self._own, self._processors) if is_known else []
            self.advice = advice(taking)
