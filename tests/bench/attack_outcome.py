"""What a run of the attack bench came to, and whether that is good enough."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

MOST_MB, LEFT_MB, LOG_MB, RATIO, STOP_S = 50.0, 15.0, 1.0, 1.1, 1.0
FOLLOWS = {"TRACK", "COAST"}
"""In any other mode a robot that hangs is where it hangs, which says nothing of its error."""
LEAST_READ: Final = 0.8
"""Of the bombs: on a busy machine pictures are given up that wait while one is decoded for long."""
ENDED: Final = "ended it"
PARSED: Final = re.compile(r"answers: (400 sdp.*|202)")


@dataclass(slots=True)
class Part:
    """What was seen in one part of the run."""

    name: str
    phone_s: list[float] = field(default_factory=list)
    """How long a paired phone waited for a new TLS connection and an answer."""
    supervisor_s: list[float] = field(default_factory=list)
    unanswered: int = 0
    rss_mb: float = 0.0
    """The most."""
    modes: set[str] = field(default_factory=set)
    error_mm: float = float("nan")
    """RMS, as the phone knows its hand and the robot's true pose."""
    missed: float = 0.0
    """Ticks of control."""
    away: float = 0.0
    """Ticks in which nobody on the machine was given a processor, as the witness saw."""
    bad_thrusts: int = 0
    """Looks at the robot's thrusts that found one no robot may be told."""

    def row(self) -> str:
        """As `HEAD` has it."""
        waits = [f"{1e3 * np.quantile(one or [np.nan], 0.95):8.0f}" for one in
                 (self.phone_s, self.supervisor_s)]  # fmt: skip
        flown = "/".join(sorted(self.modes))
        return (
            f"{self.name:9}{' '.join(waits)} {self.unanswered:10d} {self.rss_mb:8.0f}"
            f" {self.error_mm:8.1f} {self.missed:7.0f}  {flown}"
        )


HEAD = (
    "part      phone ms superv. ms  unanswered   RSS MB   RMS mm  missed  modes"
    "   (p95; new connections)"
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one run."""

    flew: bool
    quiet: Part
    attacked: tuple[Part, ...]
    """By others, where somebody flew; by others and by who leads."""
    after: Part
    stop_s: float
    thrust_after: int
    """Looks that found thrust after STOP had led to none."""
    log_mb: float
    tally: dict[str, int]
    """What others did beside a leader who attacks."""
    did: dict[str, int]
    """What the leading phone did; empty if it did not live to tell."""
    undecodable: dict[str, float]
    """Pictures of the leading phone, by what became of them in the decoder."""

    @property
    def parts(self) -> tuple[Part, ...]:
        """In the order of time."""
        return self.quiet, *self.attacked, self.after

    def done(self, what: str) -> int:
        """How many `bombs` or `answers` the leading phone sent."""
        return sum(n for name, n in self.did.items() if name.startswith(what))

    @property
    def unread(self) -> list[str]:
        """What became of hostile answers that did not come to the parser."""
        return [name for name in self.did if "answers" in name and not PARSED.fullmatch(name)]

    def goals(self) -> Iterator[tuple[bool, str]]:
        """(met, words) of each; the last three are of flights."""
        yield from self._answered()
        yield from self._reached()
        yield from self._safe()
        missed = sum(part.missed for part in self.attacked)
        away = sum(part.away for part in self.attacked)
        yield missed <= away, f"control missed {missed:.0f} ticks, the machine {away:.0f}"
        flown = self.quiet, *self.attacked
        modes = {mode for part in flown for mode in part.modes}
        follows = self.flew and modes <= FOLLOWS
        yield follows, f"led all the time: {'/'.join(sorted(modes)) or 'never'}"
        ratio = self.attacked[0].error_mm / max(self.quiet.error_mm, 1.0)
        words = f"pose error attacked by others {ratio:.2f} × the quiet flight's, {RATIO}"
        yield follows and ratio <= RATIO, words

    def _answered(self) -> Iterator[tuple[bool, str]]:
        unanswered = sum(part.unanswered for part in self.attacked)
        most = max(part.rss_mb for part in self.attacked)
        grown, left = most - self.quiet.rss_mb, self.after.rss_mb - self.quiet.rss_mb
        yield unanswered == 0, f"unanswered under attack: {unanswered}"
        yield self.stop_s <= STOP_S, f"STOP under attack to no thrust: {self.stop_s:.2f} s"
        yield grown <= MOST_MB, f"memory +{grown:.0f} MB, at most {MOST_MB:g}"
        yield left <= LEFT_MB, f"memory after it +{left:.0f} MB, at most {LEFT_MB:g}"
        yield self.log_mb <= LOG_MB, f"log {self.log_mb:.3f} MB, at most {LOG_MB:g}"

    def _reached(self) -> Iterator[tuple[bool, str]]:
        """Whether the attacks came to whom they were meant for."""
        sent, answers = self.done("bombs"), self.done("answers")
        read, ended = sum(self.undecodable.values()), self.undecodable[ENDED]
        words = f"{sent} bombs sent by who leads, {read:.0f} read by the decoder, {ended:.0f} fatal"
        yield ended > 0 and LEAST_READ * sent <= read <= sent, words
        words = f"{answers} hostile answers, not read by the parser: {self.unread or 'none'}"
        yield answers > 0 and not self.unread, words

    def _safe(self) -> Iterator[tuple[bool, str]]:
        bad = sum(part.bad_thrusts for part in self.parts)
        yield bad == 0, f"looks that found a thrust beyond limits: {bad}"
        yield self.thrust_after == 0, f"looks that found thrust after STOP: {self.thrust_after}"
        believed = [name for name in self.tally if name.isupper()]
        yield not believed, f"others who were let in or believed: {believed or 'none'}"
