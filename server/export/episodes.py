"""Episodes: from a press of the hold-to-move button to its release."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from server.export.decoded import DatedTouch, Item


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
) -> Iterator[Episode]:
    """Each of them; `discard` numbers those that nobody should learn from."""
    number, begun, last = 0, None, 0.0
    for item in items:
        if not isinstance(item, DatedTouch):
            continue
        last, held = item.t, item.held and item.visible
        if begun is not None and not (held and item.press == begun.press):
            yield Episode(number, begun.t, last, task, number not in discard)
            number, begun = number + 1, None
        if begun is None and held:
            begun = item
    if begun is not None:
        yield Episode(number, begun.t, last, task, number not in discard)
