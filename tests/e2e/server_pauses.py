"""Pauses of the listening process while a robot was armed, and what of each the machine is to blame
for: only what the witness proves, a process of its own that goes before everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from server.control.tick_rate import OVER_S
from tests.e2e.flight_log import AT_REST, Said
from tests.e2e.witness import Hole

MOST_S: Final = 0.02
"""That the server may pause by itself."""
FIGURES: Final = (
    "recent_stall_until_ms",
    "recent_stall_ms",
    "recent_stall_cpu_ms",
    "recent_stall_waited_ms",
)
SLACK_S: Final = 0.01
"""Two ticks of the witness, and of what measures the pauses."""


@dataclass(frozen=True, slots=True)
class Pause:
    """The longest between two statuses."""

    until: float
    """Its end [s, monotonic]."""
    s: float
    cpu_s: float
    """Of it at work."""
    waited_s: float
    """Of it the loop could have run and had no processor: whoever had it, that excuses nothing."""

    def proven_s(self, holes: Iterable[Hole]) -> float:
        """So long the machine was away meanwhile, at most all of it.

        What a host took from a processor is known of some half second alone.
        """
        begin, end, away, taken = self.until - self.s - SLACK_S, self.until + SLACK_S, 0.0, 0.0
        for hole in holes:
            if hole.where == "machine":
                away += max(0.0, min(end, hole.t) - max(begin, hole.t - hole.s))
            elif hole.where == "stolen" and hole.t - OVER_S < end and hole.t > begin:
                taken = max(taken, hole.s)
        return min(self.s, max(away, taken))

    def words(self, began: float, holes: Iterable[Hole]) -> str:
        """For people; times since `began` [s, monotonic]."""
        parts = self.s, self.cpu_s, self.waited_s, self.proven_s(holes)
        s, cpu, waited, proven = (1e3 * part for part in parts)
        shares = f"{cpu:.0f} ms at work, {waited:.0f} ms without a processor"
        paused = f"the server paused for {s:.0f} ms: {shares}"
        return f"{self.until - began:6.1f} s {paused}, the machine away for {proven:.0f} ms"


def pauses(said: Sequence[Said], longer_s: float = MOST_S) -> list[Pause]:
    """Those while the robot was armed."""
    told = [
        Pause(*(1e-3 * now.server.get(name, 0.0) for name in FIGURES))
        for before, now in pairwise(said)
        if before.mode not in AT_REST and now.mode not in AT_REST
    ]
    return [pause for pause in told if pause.s > longer_s]


def own_s(said: Sequence[Said], holes: Sequence[Hole]) -> float:
    """The longest, less what is proven of each [s]; 0 without any that is too long."""
    return max((one.s - one.proven_s(holes) for one in pauses(said)), default=0.0)
