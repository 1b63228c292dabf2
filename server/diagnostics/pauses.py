"""How long the listening process stood still: its event loop's holes, its garbage collections."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from server.common import clock
from server.common.clock import now
from server.diagnostics.garbage import Garbage

LOOK_S = 0.005
WINDOW_S = 60.0
WORTH_SAYING_S = 0.02
SAY_AGAIN_S = 10.0


class RunQueue:
    """How long the thread that makes it has waited for a processor."""

    def __init__(self) -> None:
        """Watch the calling thread."""
        self._file = -1
        with contextlib.suppress(OSError):  # of Linux alone
            self._file = os.open("/proc/thread-self/schedstat", os.O_RDONLY | os.O_CLOEXEC)

    def __call__(self) -> float:
        """Time waited in all [s]; 0 where unknown."""
        return 1e-9 * int(os.pread(self._file, 100, 0).split()[1]) if self._file >= 0 else 0.0

    def close(self) -> None:
        """Give the file back."""
        if self._file >= 0:
            os.close(self._file)


@dataclass(frozen=True, slots=True)
class Stall:
    """The loop was late."""

    late_s: float = 0.0
    cpu_s: float = 0.0
    """Processor time of this process meanwhile."""
    waited_s: float = 0.0
    """How long the loop could have run meanwhile, and was given no processor."""


class LoopWatch:
    """Longest stalls of an event loop, by a ticker in it."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._worst: deque[tuple[float, Stall]] = deque()
        """In the window, each shorter than the one before."""
        self.armed = Stall()
        """The longest while a robot was armed, the last time it was."""
        self.recent, self.t_recent = Stall(), 0.0
        """The longest since whoever asks last set this back; its end [s]."""

    def add_stall(self, t: float, stall: Stall, armed: bool) -> None:
        """A tick at `t` [s] was late."""
        if armed and stall.late_s > self.armed.late_s:
            self.armed = stall
        if stall.late_s > self.recent.late_s:
            self.recent, self.t_recent = stall, t
        while self._worst and self._worst[-1][1].late_s <= stall.late_s:
            self._worst.pop()
        self._worst.append((t, stall))

    def lately(self, t: float) -> Stall:
        """The longest of the last minute before `t` [s]."""
        while self._worst and self._worst[0][0] < t - WINDOW_S:
            self._worst.popleft()
        return self._worst[0][1] if self._worst else Stall()


class Pauses:
    """Pauses of this process: kept short, measured, logged."""

    def __init__(
        self,
        clock: Callable[[], float] = now,
        cpu: Callable[[], float] = clock.process_cpu,
        thread_cpu: Callable[[], float] = clock.thread_cpu,
        on_stall: Callable[[float, float], None] | None = None,
        waited: Callable[[], float] | None = None,
    ) -> None:
        """Clocks [s]; `on_stall` is told when the loop was late, and by how much [s].

        `waited` is what `RunQueue` of the loop's thread tells.
        """
        self._on_stall = on_stall
        self._clock, self._cpu, self._waited = clock, cpu, waited
        self.garbage = Garbage(thread_cpu)
        self.loop = LoopWatch()
        self._is_armed = False
        self._t_said, self._said = -float("inf"), Stall()

    async def watch(self) -> None:
        """Tick in the running loop until cancelled."""
        with contextlib.closing(RunQueue()) as queue:
            await self._watch(self._waited or queue)

    async def _watch(self, waited: Callable[[], float]) -> None:
        due, cpu, wait = self._clock() + LOOK_S, self._cpu(), waited()
        while True:
            await asyncio.sleep(LOOK_S)
            t, now_cpu, now_wait = self._clock(), self._cpu(), waited()
            late = max(0.0, t - due)
            stall = Stall(late, min(late, now_cpu - cpu), min(late, now_wait - wait))
            self.loop.add_stall(t, stall, self._is_armed)
            if self._on_stall is not None:
                self._on_stall(t, late)
            due, cpu, wait = t + LOOK_S, now_cpu, now_wait

    def tick(self, armed: bool, idle: bool) -> str:
        """Keep garbage small; gives what people should read, or "".

        To be called some ten times a second. `idle`: nobody leads the robot.
        """
        if armed and not self._is_armed:
            self.garbage.reset()
            self.loop.armed = Stall()
            self._said = Stall()
        self._is_armed = self.garbage.counts = armed
        self.garbage.tick(idle and not armed)
        self.loop.recent = Stall()
        return self._words() if armed else ""

    def _words(self) -> str:
        worst, t = self.loop.armed, self._clock()
        if worst.late_s <= max(WORTH_SAYING_S, self._said.late_s) or t < self._t_said + SAY_AGAIN_S:
            return ""
        self._said, self._t_said = worst, t
        late, own, waited = 1e3 * worst.late_s, 1e3 * worst.cpu_s, 1e3 * worst.waited_s
        shares = f"{own:.0f} ms at work, {waited:.0f} ms without a processor"
        return f"The server stood still for {late:.0f} ms while armed: {shares}."

    def figures(self) -> dict[str, float]:
        """Figures for a status [ms]."""
        lately, armed, recent = self.loop.lately(self._clock()), self.loop.armed, self.loop.recent
        return {
            "stall_ms": round(1e3 * lately.late_s, 1),
            "armed_stall_ms": round(1e3 * armed.late_s, 1),
            "armed_stall_cpu_ms": round(1e3 * armed.cpu_s, 1),
            "armed_stall_waited_ms": round(1e3 * armed.waited_s, 1),
            "recent_stall_ms": round(1e3 * recent.late_s, 1),
            "recent_stall_cpu_ms": round(1e3 * recent.cpu_s, 1),
            "recent_stall_waited_ms": round(1e3 * recent.waited_s, 1),
            "recent_stall_until_ms": round(1e3 * self.loop.t_recent, 1),
            "gc_ms": round(1e3 * self.garbage.longest_s, 2),
            "gc_full": float(self.garbage.count),
        }

    def close(self) -> None:
        """Leave garbage to Python again."""
        self.garbage.close()
