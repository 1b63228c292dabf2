"""How far long work is: a bar on a terminal, a line every tenth elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import TextIO

from server.common.clock import now

BAR = 30
EVERY_S = 0.1
STEP = 10
"""Percent between two lines, where there is no terminal."""


class Progress:
    """Of `total` things, or of an unknown number of them."""

    def __init__(self, total: int | None, stream: TextIO, clock: Callable[[], float] = now) -> None:
        """`clock` [s]."""
        self._total, self._stream, self._clock = total, stream, clock
        self._tty = stream.isatty()
        self._started = self._shown = clock()
        self._done = self._told = 0
        self._words = ""

    def advance(self, words: str = "") -> None:
        """One more is done."""
        self._done += 1
        self._words = words
        if self._tty:
            now = self._clock()
            if now - self._shown >= EVERY_S:
                self._shown = now
                self._show(now)
        elif self._total is not None:
            percent = 100 * self._done // self._total
            if percent >= self._told + STEP:
                self._told = percent - percent % STEP
                left = self._left_s(self._clock() - self._started)
                remaining = f", {left:.0f} s left" if left > 0.0 else ""
                self._stream.write(f"{self._told} %  {words}{remaining}\n")
                self._stream.flush()

    def close(self) -> None:
        """Leave the line as it is in the end."""
        if self._tty and self._done:
            self._show(self._clock(), "\n")

    def _show(self, now: float, end: str = "") -> None:
        self._stream.write(f"\r\x1b[K{self._bar(now)}  {self._words}{end}")
        self._stream.flush()

    def _bar(self, now: float) -> str:
        passed = now - self._started
        rate = self._done / passed if passed > 0.0 else 0.0
        if self._total is None:
            return f"{self._done} frames, {rate:.0f}/s"
        share = min(1.0, self._done / self._total)
        bar = "█" * round(BAR * share)
        speed = f"{rate:.0f}/s" if rate >= 10.0 else f"{rate:.1f}/s"
        left = self._left_s(passed)
        return f"{100.0 * share:3.0f} % {bar:·<{BAR}} {speed}, {left:.0f} s left"

    def _left_s(self, passed: float) -> float:
        """As far as what is done tells [s]."""
        assert self._total is not None
        return max(0.0, passed * (self._total - self._done) / self._done) if self._done else 0.0
