"""Two networks that reach each other only over an emulated line, each direction with its own will.

A thread reads the packets of both networks' wires, keeps them as `channel` says, and writes
them into the other one.
"""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from hardware.sim.network.channel import CLEAN, ChannelEmulator, Conditions, Counts
from hardware.sim.network.netns import MTU, Namespace

ADDRESSES = ("10.77.0.1", "10.77.0.2")
PRIORITY = 45
"""Below control's: the line must be as late as it is told to be, not as the machine is busy."""
REMEMBERED = 20_000
"""Packets, for how late they were."""
WAKE_S = 0.5


@dataclass(frozen=True, slots=True)
class Lateness:
    """How much later than it should the emulator itself was, of its last packets [s]."""

    p50: float
    p99: float
    worst: float


class _Direction:
    """One direction, from one wire to the other."""

    def __init__(self, source: int, sink: int) -> None:
        self.source, self.sink = source, sink
        self.renew(ChannelEmulator())

    def renew(self, line: ChannelEmulator) -> None:
        """Go on as another line."""
        self.line, self.unwritten = line, 0
        self.late: deque[float] = deque(maxlen=REMEMBERED)

    def read(self) -> None:
        """Take all packets that wait; other than IPv4 ones are not for the line."""
        with contextlib.suppress(BlockingIOError):
            while packet := os.read(self.source, MTU):
                if packet[0] >> 4 == 4:
                    self.line.put(time.monotonic(), packet)

    def write(self) -> None:
        """Hand out what is due."""
        for t_due, packet in self.line.take(time.monotonic()):
            try:
                os.write(self.sink, packet)
            except OSError:  # its queue is full, or it is down
                self.unwritten += 1
            self.late.append(time.monotonic() - t_due)


class EmulatedLink:
    """`near` and `far`, two networks; packets flow between them while it is open."""

    def __init__(
        self, to_far: Conditions = CLEAN, to_near: Conditions = CLEAN, seed: int = 0
    ) -> None:
        """The same `seed` gives the same packets the same fate.

        Raises:
            NamespaceError: not as this user, or not on this machine.
        """
        with contextlib.ExitStack() as opened:
            self.near = Namespace(ADDRESSES[0])
            opened.callback(self.near.close)
            self.far = Namespace(ADDRESSES[1])
            opened.callback(self.far.close)
            self._to_far = _Direction(self.near.wire, self.far.wire)
            self._to_near = _Direction(self.far.wire, self.near.wire)
            self._lock = threading.Lock()
            self.renew(to_far, to_near, seed)
            self._awake, self._wake = os.pipe()
            for end in (self._awake, self._wake):
                opened.callback(os.close, end)
            self._running = True
            self._thread = threading.Thread(target=self._run, name="link", daemon=True)
            self._thread.start()
            self._opened = opened.pop_all()

    def __enter__(self) -> EmulatedLink:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def renew(self, to_far: Conditions, to_near: Conditions, seed: int) -> None:
        """Begin anew, with other conditions: counts from zero, what is on its way is lost."""
        seeds = np.random.SeedSequence(seed).spawn(2)
        with self._lock:
            self._to_far.renew(ChannelEmulator(to_far, seeds[0]))
            self._to_near.renew(ChannelEmulator(to_near, seeds[1]))

    def shape(self, to_far: Conditions | None = None, to_near: Conditions | None = None) -> None:
        """Change the conditions, of one direction or both; packets on their way don't notice."""
        with self._lock:
            if to_far is not None:
                self._to_far.line.conditions = to_far
            if to_near is not None:
                self._to_near.line.conditions = to_near

    def counts(self) -> tuple[Counts, Counts]:
        """Counts of packets (to `far`, to `near`) so far."""
        with self._lock:
            return self._to_far.line.counts, self._to_near.line.counts

    @property
    def is_empty(self) -> bool:
        """No packet is on its way."""
        with self._lock:
            return self._to_far.line.is_empty and self._to_near.line.is_empty

    def lateness(self) -> Lateness:
        """How far the emulator was late; zeros before the first packet."""
        with self._lock:
            late = [*self._to_far.late, *self._to_near.late] or [0.0]
        p50, p99, worst = np.percentile(late, (50.0, 99.0, 100.0)).tolist()
        return Lateness(p50, p99, worst)

    @property
    def unwritten(self) -> int:
        """Packets a wire would not take."""
        return self._to_far.unwritten + self._to_near.unwritten

    def close(self) -> None:
        """Stop, and let the networks go."""
        if self._running:
            self._running = False
            os.write(self._wake, b"x")
            self._thread.join()
            self._opened.close()

    def _run(self) -> None:
        with contextlib.suppress(AttributeError, OSError):  # of this thread alone
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        directions = (self._to_far, self._to_near)
        files = [self._awake, *(direction.source for direction in directions)]
        while self._running:
            readable, _, _ = select.select(files, [], [], self._pause(directions))
            with self._lock:
                for direction in directions:
                    if direction.source in readable:
                        direction.read()
                    direction.write()

    @staticmethod
    def _pause(directions: Sequence[_Direction]) -> float:
        """Time until the next packet is due [s]."""
        dues = [due for direction in directions if (due := direction.line.due()) is not None]
        return max(0.0, min(dues) - time.monotonic()) if dues else WAKE_S
