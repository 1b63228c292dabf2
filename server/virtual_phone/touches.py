"""A page's TOUCHes, numbered: some are said again, with the nonce of a PING. Sans-I/O."""

from __future__ import annotations

from dataclasses import replace

from server.protocol.wire_records import Record, Touch

NEWEST_TOUCH_US = 100_000
"""An older TOUCH is not said again: whoever makes them may have stopped."""


class Touches:
    """Remembers the newest one."""

    def __init__(self) -> None:
        """Begin before the first TOUCH."""
        self._count = 0
        self._newest: tuple[int, Touch] | None = None

    def numbered(self, t_us: int, touch: Touch) -> Record:
        """A TOUCH made at `t_us` [µs of the page's clock]."""
        self._newest = (t_us, touch)
        return self._record(t_us, touch)

    def again(self, t_us: int, nonce: int) -> Record | None:
        """The newest one at `t_us` [µs], as answer to a PING; None if it is too old, or none."""
        if self._newest is None or t_us - self._newest[0] > NEWEST_TOUCH_US:
            return None
        return self._record(t_us, replace(self._newest[1], nonce=nonce))

    def _record(self, t_us: int, touch: Touch) -> Record:
        self._count += 1
        return Record(self._count, t_us, touch)
