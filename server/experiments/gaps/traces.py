"""Recorded minutes of radio links; `traces/README.md` says where they are from."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from server.experiments.gaps.schedule import Segment, TraceLine

FILE: Final = Path(__file__).parent / "traces" / "traces.json"
MINUTE_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Minute:
    """One minute of one link."""

    name: str
    kind: str
    """cellular or wifi."""
    what: str
    is_typical: bool
    """Its held time is the median of the recording's minutes; else the largest."""
    up: tuple[Segment, ...]
    down: tuple[Segment, ...]

    def line(self, begin_s: float) -> TraceLine:
        """To fly with, from `begin_s` [s] on."""
        return TraceLine(list(self.up), list(self.down), MINUTE_S, begin_s)

    @property
    def longest_s(self) -> float:
        """The longest that something was held back."""
        return max((out - begin for begin, _, out in (*self.up, *self.down)), default=0.0)

    @property
    def gaps(self) -> int:
        """How often something was held back for 80 ms or longer."""
        return sum(out - begin >= 0.080 for begin, _, out in (*self.up, *self.down))


@cache
def minutes() -> tuple[Minute, ...]:
    """All minutes, typical ones first."""
    found = []
    for name, trace in json.loads(FILE.read_text(encoding="utf-8")).items():
        for which, minute in trace["minutes"].items():
            up = _segments(minute["up"])
            down = _segments(minute["down"]) if "down" in minute else up
            label = name if which == "typical" else f"{name}, {which}"
            found.append(Minute(label, trace["kind"], trace["what"], which == "typical", up, down))
    return tuple(sorted(found, key=lambda minute: not minute.is_typical))


def _segments(rows: list[list[int]]) -> tuple[Segment, ...]:
    """Segments of [from, for, late after that] in ms."""
    return tuple(
        (1e-3 * begin, 1e-3 * (begin + length), 1e-3 * (begin + length + late))
        for begin, length, late in rows
    )
