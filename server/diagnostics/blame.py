"""Whose silence it was: a server that stood still makes a phone look silent. Sans-I/O."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from server.control.gap_log import LATELY_S, MANY, WORDS, GapStatistics
from server.control.ipc import ControlStatus

STALL_S = 0.1
"""So long a stall of the server's loop makes all that comes of a phone too old."""
RECENT_S = 1.0
"""So long before control said that the phone is silent a stall may have been."""
SILENT = ("No word from the phone.", "The phone's motion sensors are silent.")
TOO_BUSY = "The server's computer was too busy."


class Blame:
    """Remembers the stalls of the server's loop, and what control said first after one."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._stalls: deque[tuple[float, float]] = deque()
        self._said: tuple[int, int, str] | None = None
        self._is_ours = False

    def stalled(self, now: float, late_s: float) -> None:
        """The server's loop was late by so much at `now` [s]."""
        if late_s > STALL_S:
            self._stalls.append((now, late_s))

    def reason(self, control: ControlStatus, now: float) -> str:
        """Control's reason, in which the server's own stall is not called a silent phone."""
        said = (control.epoch, control.mode, control.reason)
        if said != self._said:
            self._said = said
            self._is_ours = bool(self._stalls) and now - self._stalls[-1][0] < RECENT_S
        return _ours(control.reason) if self._is_ours else control.reason

    def gaps(self, control: ControlStatus, now: float) -> dict[str, GapStatistics]:
        """Gaps of the last minute by side, with the server's own on its."""
        while self._stalls and now - self._stalls[0][0] > LATELY_S:
            self._stalls.popleft()
        gaps = dict(control.gaps)
        if not gaps or not self._stalls:
            return gaps
        count, longest = len(self._stalls), max(late for _, late in self._stalls)
        phone, server = gaps["phone"], gaps["server"]
        left = max(0, phone.count - count)
        gaps["phone"] = GapStatistics(left, phone.longest_s if left else 0.0)
        gaps["server"] = GapStatistics(
            server.count + count, max(server.longest_s, round(longest, 3))
        )
        return gaps


def warnings(gaps: Mapping[str, GapStatistics]) -> list[str]:
    """Warnings of gaps for somebody who arms."""
    return [
        WORDS[side].format(one.count, one.longest_s)
        for side, one in gaps.items()
        if one.count >= MANY
    ]


def _ours(reason: str) -> str:
    for words in SILENT:
        reason = reason.replace(words, TOO_BUSY)
    return reason
