"""Whose silence it was: a server that stood still makes a phone look silent. Sans-I/O.

Whoever was too busy is named, with what to do about it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import inf

from server.control.gap_log import LATELY_S, MANY, WORDS, GapStatistics
from server.control.ipc import ControlStatus
from server.diagnostics.load import ADVICE, IS_BUSY

STALL_S = 0.1
"""So long a stall of the server's loop makes all that comes of a phone too old."""
RECENT_S = 1.0
"""So long before control said that the phone is silent a stall may have been."""
SILENT = ("No word from the phone.", "The phone's motion sensors are silent.")
TOO_BUSY = "The server's computer was too busy."
LATE = ("The server's computer stood still", "Control runs slowly")
"""How control begins when it tells of its own computer."""
OLD_PICTURES = "Pictures are "
"""How it begins when it refuses to arm for them: a busy computer is one reason."""
PICTURES_GO_ON_S = 0.075
"""Pictures younger than half of the silence that control bears: no link was silent, a page was."""
PHONE_BUSY = (
    "The phone was too busy: it sent pictures, and no word. Close other apps on it, end power "
    "saving, let it cool down."
)


class Blame:
    """Remembers the stalls of the server's loop, and what control said first after one."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._stalls: deque[tuple[float, float]] = deque()
        self._said: tuple[int, int, str] | None = None
        self._explained = ""

    def stalled(self, now: float, late_s: float) -> None:
        """The server's loop was late by so much at `now` [s]."""
        if late_s > STALL_S:
            self._stalls.append((now, late_s))

    def reason(
        self,
        control: ControlStatus,
        now: float,
        advice: str = ADVICE,
        picture_age_s: float = inf,
        starved: bool = False,
    ) -> str:
        """Control's reason, in which who was too busy is not called silent.

        `advice` is what to do about this computer, `picture_age_s` of the newest that has come;
        `starved`: the phone is virtual, on this computer, which is busy.
        """
        said = (control.epoch, control.mode, control.reason)
        if said != self._said:
            self._said = said
            is_ours = starved or (bool(self._stalls) and now - self._stalls[-1][0] < RECENT_S)
            went_on = picture_age_s < PICTURES_GO_ON_S
            self._explained = _explained(control.reason, is_ours, went_on, advice)
        return self._explained

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


def warnings(gaps: Mapping[str, GapStatistics], advice: str = ADVICE) -> list[str]:
    """Warnings of gaps for somebody who arms, with `advice` about this computer."""
    return [
        WORDS[side].format(one.count, one.longest_s) + (f" {advice}" if side == "server" else "")
        for side, one in gaps.items()
        if one.count >= MANY
    ]


def refusals(said: Sequence[str], busy: str) -> list[str]:
    """What control has against arming; `busy` names a busy computer that may be why, or is ""."""
    late = (*LATE, OLD_PICTURES, IS_BUSY)
    if not busy or not any(one in SILENT or one.startswith(late) for one in said):
        return list(said)
    # what the server has told control comes back a moment later, perhaps with other words
    others = [one for one in said if one not in SILENT and not one.startswith(IS_BUSY)]
    return [busy, *others]


def _explained(reason: str, is_ours: bool, pictures_go_on: bool, advice: str) -> str:
    if reason.startswith(LATE):
        return f"{reason} {advice}"
    if not is_ours:
        return reason.replace(SILENT[0], PHONE_BUSY) if pictures_go_on else reason
    for words in SILENT:
        reason = reason.replace(words, f"{TOO_BUSY} {advice}")
    return reason
