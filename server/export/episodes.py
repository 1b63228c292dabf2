"""Episodes: from a press of the hold-to-move button to its release."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from server.export.decoded import DatedNote, DatedTouch, Item
from server.recording.episodes import TaskNote, VerdictNote


@dataclass(frozen=True, slots=True)
class Episode:
    """What an operator did in one go."""

    number: int
    """Counts from 0."""
    t_begin: float
    """When the finger came [s]."""
    t_end: float
    """When it left, or the record ended [s]."""
    task: str
    """What it was for, in words, or ""."""
    keep: bool
    """False: nobody should learn from it."""


def episodes(
    items: Iterable[Item], task: str = "", discard: frozenset[int] = frozenset()
) -> list[Episode]:
    """Each of them, with what the recording says of it.

    `task` is for those it names none for; `discard` numbers others nobody should learn from.
    """
    found: list[Episode] = []
    presses: list[int] = []
    held: DatedTouch | None = None
    said = ""
    for item in items:
        match item:
            case DatedTouch():
                holds = item.held and item.visible
                if held is not None:
                    found[-1] = replace(found[-1], t_end=item.t)
                    held = held if holds and item.press == held.press else None
                if held is None and holds:
                    held, number = item, len(found)
                    keep = number not in discard
                    found.append(Episode(number, item.t, item.t, said or task, keep))
                    presses.append(item.press)
            case DatedNote(note=TaskNote(text)):
                said = text
            case DatedNote(note=VerdictNote(press, keep)) if press in presses:
                newest = len(presses) - 1 - presses[::-1].index(press)
                found[newest] = replace(found[newest], keep=keep and newest not in discard)
    return found
