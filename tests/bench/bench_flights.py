"""The robot led by a real Chromium over each way of pictures; each flight is tried once.

    python -m tests.bench.bench_flights [--flights 1] [--seconds 60] [--by webrtc,webcodecs,jpeg]
                                        [--record DIR]

One hand, one simulated robot, one machine; the ways take turns. Why a flight ended is told, and
every hole of more than 50 ms: of the machine, of what its host took from a processor in half a
second, of what others left of it, of the page, and the server's pauses, less what a witness proves
that the machine was away for (`server_pauses`). With `--record`, those that missed a goal leave a
recording, to find out why. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from server.common.text import flights
from tests.bench.judgement import verdict
from tests.e2e.chromium_rig import flight, led_server, start
from tests.e2e.conftest import wanted_chromium
from tests.e2e.flight_log import SHOWN_S, Flight
from tests.e2e.page_scripts import LACKING
from tests.e2e.played_phone import PlayedPhone
from tests.e2e.server_pauses import MOST_S, own_s, pauses
from tests.e2e.witness import longest

HAND, SEED, REST_S = "moving", 2, 12.0
LEARNT_S = 8.0
"""Of tracking, before the integral has learnt the suspension and the RMS counts."""
WAYS: Final = {name.lower(): name for name in LACKING}
TOLD: Final = 8
"""Of a flight's pauses, the longest."""
LEAST_FOLLOWING, MOST_RMS_MM = 97.0, 8.0
COLUMNS: Final = (
    ("way", "way", "{}"),
    ("to_the_end", "to the end", "{}"),
    ("following", "follows %", "{:.1f}"),
    ("rms_mm", "RMS mm", "{:.1f}"),
    ("holes", "holes", "{}"),
    ("machine_ms", "machine ms", "{:.0f}"),
    ("stolen_ms", "stolen ms", "{:.0f}"),
    ("others_ms", "others ms", "{:.0f}"),
    ("page_ms", "page ms", "{:.0f}"),
    ("stall_ms", "server ms", "{:.0f}"),
    ("stall_cpu_ms", "at work ms", "{:.0f}"),
    ("own_ms", "own ms", "{:.0f}"),
    ("gc_ms", "garbage ms", "{:.1f}"),
)
"""`holes` are those above 50 ms; each `…_ms` is the longest of its kind, and own that of the server
less what was the machine's."""


@dataclass(frozen=True, slots=True)
class Row:
    """One flight."""

    way: str
    to_the_end: str
    following: float
    rms_mm: float
    holes: int
    machine_ms: float
    stolen_ms: float
    others_ms: float
    page_ms: float
    stall_ms: float
    stall_cpu_ms: float
    own_ms: float
    gc_ms: float
    ended: str


def _row(way: str, flown: Flight) -> Row:
    learnt = any(t >= LEARNT_S for t, _ in flown.distances)
    told = flown.said[-1].server if flown.said else {}
    machine, stolen, others, page = (
        1e3 * longest(flown.holes, where) for where in ("machine", "stolen", "others", "page")
    )
    return Row(
        way,
        "no" if flown.ended else "yes",
        100.0 * flown.following,
        PlayedPhone.rms_mm(flown.distances, LEARNT_S) if learnt else float("nan"),
        sum(hole.s >= SHOWN_S for hole in flown.holes),
        machine,
        stolen,
        others,
        page,
        told.get("armed_stall_ms", float("nan")),
        told.get("armed_stall_cpu_ms", float("nan")),
        1e3 * own_s(flown.said, flown.holes) if flown.said else float("nan"),
        told.get("gc_ms", float("nan")),
        flown.ended,
    )


def flown_by(way: str, executable: str, seconds: float, kept: Path | None) -> Flight:
    """A real browser leads, with a server of its own; `kept` gets its recording if it missed."""
    with tempfile.TemporaryDirectory() as folder:
        rig = led_server(executable, Path(folder), HAND, seed=SEED, rest_s=REST_S)
        with rig as (server, _, phone):
            for script in LACKING[way]:
                phone.page.add_init_script(script)
            start(phone, server)
            if kept is None:
                return flight(phone, server, seconds)
            server.request("POST", "/api/recording")
            flown = flight(phone, server, seconds)
            recorded = str(server.request("DELETE", "/api/recording")["path"])
            if not all(met for met, _ in goals([_row(way, flown)])):
                kept.parent.mkdir(parents=True, exist_ok=True)
                shutil.move(recorded, kept)
            return flown


def goals(rows: Sequence[Row]) -> Iterator[tuple[bool, str]]:
    """(met, words) of each."""
    for way in dict.fromkeys(row.way for row in rows):
        of_way = [row for row in rows if row.way == way]
        ends = sum(row.to_the_end == "yes" for row in of_way)
        yield ends == len(of_way), f"{way}: {ends} of {len(of_way)} to the end"
        least = min(row.following for row in of_way)
        words = f"{way}: follows {least:.1f} % of the time, at least {LEAST_FOLLOWING:g}"
        yield least >= LEAST_FOLLOWING, words
        worst = max(row.rms_mm for row in of_way)
        yield worst <= MOST_RMS_MM, f"{way}: RMS {worst:.1f} mm, at most {MOST_RMS_MM:g}"
        own_ms, most_ms = max(row.own_ms for row in of_way), 1e3 * MOST_S
        words = f"{way}: server's longest pause of its own {own_ms:.0f} ms, at most {most_ms:g}"
        yield own_ms <= most_ms, words


def _ways(text: str) -> list[str]:
    names = text.split(",")
    if not set(names) <= set(WAYS):
        raise argparse.ArgumentTypeError(f"{text}: allowed: {', '.join(WAYS)}, with commas")
    return [WAYS[name] for name in names]


def arguments() -> argparse.Namespace:
    parser = Parser(prog="python -m tests.bench.bench_flights", description=__doc__)
    parser.add_argument("--flights", type=int, default=1, help="by each way")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--by", type=_ways, default=list(WAYS.values()), metavar=",".join(WAYS))
    parser.add_argument("--record", type=Path, metavar="DIR")
    return parser.parse_args()


def main() -> int:
    """Fly, tell, judge."""
    told, executable = arguments(), wanted_chromium()
    rows: list[Row] = []
    for n, way in product(range(told.flights), told.by):
        kept = told.record and told.record / f"{way.lower()}_{n + 1}.mcap"
        one = flown_by(way, executable, told.seconds, kept)
        rows.append(_row(way, one))
        seen = f"{rows[-1].rms_mm:.1f} mm RMS, load {os.getloadavg()[0]:.1f}"
        print(f"{way} {n + 1}, {seen}: {one.account()}", file=sys.stderr, flush=True)
        for pause in sorted(pauses(one.said), key=lambda one: -one.s)[:TOLD]:
            words = pause.words(one.said[0].t, one.holes)
            print(f"  {words}", file=sys.stderr, flush=True)
    print(f"{flights(COLUMNS, rows)}")
    return verdict(goals(rows))


if __name__ == "__main__":
    sys.exit(main())
