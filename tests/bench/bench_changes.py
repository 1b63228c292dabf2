"""A real Chromium leads the robot, and its operator changes the way of the pictures by hand.

    python -m tests.bench.bench_changes [--flights 5]

Each flight goes by each way and back, as often as there are ways. How far the robot is from where
the hand means it is told of the seconds before a change and of those after: a way dates pictures by
clocks of its own, and what changes with them is where they say the robot is. The exit code is 1 if
a goal is missed.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from server.common.options import Parser
from server.common.text import table
from tests.bench.judgement import verdict
from tests.e2e.chromium_rig import WAYS, flight, led_server, start
from tests.e2e.conftest import wanted_chromium
from tests.e2e.flight_log import Flight

HAND, SEED, REST_S = "moving", 1, 15.0
"""This hand never leads farther than the thrusters hold, where a leash would keep the robot."""
LEARNT_S, EACH_S = 10.0, 6.0
"""Before the integral has learnt the suspension; between two changes."""
BEFORE_S, AFTER_S = 2.0, 4.0
"""Looked at, of each change: a connection takes a second or two to be made."""
ROUND: Final = ("WebRTC", "WebSocket", "JPEG", "WebRTC", "JPEG", "WebSocket", "WebRTC")
"""Each way into each other."""
MOST_RMS_MM = 10.0
COLUMNS: Final = (
    ("change", "change", "{}"),
    ("count", "times", "{}"),
    ("before_mm", "RMS before", "{:.1f}"),
    ("after_mm", "RMS after", "{:.1f}"),
    ("worst_before_mm", "worst before", "{:.1f}"),
    ("worst_after_mm", "worst after", "{:.1f}"),
    ("farthest_mm", "farthest", "{:.1f}"),
)
"""All in millimetres; the worst are of one change."""


@dataclass(frozen=True, slots=True)
class Change:
    """One change of one flight, distances of the robot from where the hand means it [m]."""

    words: str
    before: np.ndarray
    """(n,)"""
    after: np.ndarray
    """(m,)"""


@dataclass(frozen=True, slots=True)
class Row:
    """All changes of one way into another [mm]."""

    change: str
    count: int
    before_mm: float
    after_mm: float
    worst_before_mm: float
    worst_after_mm: float
    farthest_mm: float


def _rms_mm(distances: np.ndarray) -> float:
    return 1e3 * float(np.sqrt(np.mean(np.square(distances))))


def rows(changes: Sequence[Change]) -> Iterator[Row]:
    """A row of each way into another."""
    for words in dict.fromkeys(change.words for change in changes):
        of_it = [change for change in changes if change.words == words]
        yield Row(
            words,
            len(of_it),
            _rms_mm(np.concatenate([change.before for change in of_it])),
            _rms_mm(np.concatenate([change.after for change in of_it])),
            max(_rms_mm(change.before) for change in of_it),
            max(_rms_mm(change.after) for change in of_it),
            1e3 * max(float(change.after.max()) for change in of_it),
        )


def flown_through(executable: str) -> tuple[Flight, list[Change], list[str]]:
    """A flight by all ways; its changes, and what the server said that came of each."""
    came: list[str] = []
    starts = [LEARNT_S + EACH_S * k for k in range(len(ROUND))]
    with tempfile.TemporaryDirectory() as folder:
        rig = led_server(executable, Path(folder), HAND, seed=SEED, rest_s=REST_S)
        with rig as (server, _, phone):

            def look() -> None:
                came.append(str(server.request("GET", "/api/status")["video_path"]))

            wishes = [(starts[0] - 0.1, look)]
            for begin, wish in zip(starts[:-1], ROUND[1:], strict=True):
                wishes.append((begin, partial(phone.choose, "#path-wish", wish)))
                wishes.append((begin + EACH_S - 0.1, look))
            start(phone, server)
            phone.play_until("document.querySelector('#h-path').innerText === 'WebRTC'", 25.0)
            one = flight(phone, server, starts[-1], wishes)
    t, distances = np.array(one.distances).reshape(-1, 2).T
    changes = [
        Change(
            f"{old} to {new}",
            distances[(t >= begin - BEFORE_S) & (t < begin)],
            distances[(t >= begin) & (t < begin + AFTER_S)],
        )
        for begin, (old, new) in zip(starts[:-1], pairwise(ROUND), strict=True)
        if t.size and begin + AFTER_S <= t[-1]
    ]
    return one, changes, came


def main() -> int:
    """Fly, tell, judge."""
    parser = Parser(prog="python -m tests.bench.bench_changes", description=__doc__)
    parser.add_argument("--flights", type=int, default=5)
    told, executable = parser.parse_args(), wanted_chromium()
    changes: list[Change] = []
    ends = ways = 0
    for n in range(told.flights):
        one, its_changes, came = flown_through(executable)
        changes += its_changes
        ends += not one.ended
        ways += [way.startswith(WAYS[wish]) for way, wish in zip(came, ROUND, strict=False)].count(
            True
        )
        print(f"{n + 1}: {one.account()}; {came}", file=sys.stderr, flush=True)
    told_rows = list(rows(changes))
    print(table(COLUMNS, told_rows))
    wanted = told.flights * len(ROUND)
    worst = max((row.worst_after_mm for row in told_rows), default=float("nan"))
    goals = (
        (ends == told.flights, f"{ends} of {told.flights} to the end"),
        (ways == wanted, f"{ways} of {wanted} times pictures came by the way that was chosen"),
        (worst <= MOST_RMS_MM, f"RMS after a change {worst:.1f} mm, at most {MOST_RMS_MM:g}"),
    )
    return verdict(goals)


if __name__ == "__main__":
    sys.exit(main())
