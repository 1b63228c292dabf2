"""How far what a robot is given has fallen in a silence."""

from __future__ import annotations


class Fading:
    """A ramp to zero. Times are [µs]."""

    def __init__(self, ramp_us: int) -> None:
        """Not begun."""
        self._ramp_us = ramp_us
        self._since_us: int | None = None

    def __bool__(self) -> bool:
        """Whether it has begun."""
        return self._since_us is not None

    def begin(self, since_us: int) -> None:
        """Fall from then on; the first to say so counts."""
        if self._since_us is None:
            self._since_us = since_us

    def end(self) -> None:
        """Follow again."""
        self._since_us = None

    def elapsed_us(self, now_us: int) -> int:
        """For how long it has been falling; 0 while it follows."""
        return 0 if self._since_us is None else max(0, now_us - self._since_us)

    def left(self, now_us: int) -> float:
        """What share is left: 1 at its beginning, 0 at its end."""
        return max(0.0, 1.0 - self.elapsed_us(now_us) / self._ramp_us)

    def is_over(self, now_us: int) -> bool:
        """Whether it has come to zero."""
        return self._since_us is not None and now_us - self._since_us >= self._ramp_us
