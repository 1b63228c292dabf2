"""What a recording costs the server while a phone is led by: its processor, and its disk.

    python -m tests.bench.bench_recording [--minutes 10]

One flight by a virtual phone; recording is on and off by turns, each for a quarter of a minute, so
that what else the machine does meets both. The exit code is 1 if the goal is missed.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

from mcap.reader import make_reader

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from server.common.ranges import number
from server.common.text import table
from tests.bench.steady_phone import leading
from tests.e2e.serving import Serving, serving

TURN_S: Final = 15.0
MOST_SHARE = 0.01
CPU: Final = "process_cpu_seconds_total"
"""Of the process that records."""
COLUMNS: Final = (
    ("what", "recording", "{}"),
    ("turns", "turns", "{}"),
    ("share", "the server's CPU, of a core", "{:.2%}"),
)


@dataclass(frozen=True, slots=True)
class Turns:
    """All turns of a kind."""

    what: str
    turns: int
    share: float


@dataclass(frozen=True, slots=True)
class Written:
    """Recordings."""

    seconds: float = 0.0
    messages: int = 0
    size: int = 0

    def with_file(self, path: Path, seconds: float) -> Written:
        """And one more, of so long."""
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        count = self.messages + summary.statistics.message_count
        return Written(self.seconds + seconds, count, self.size + path.stat().st_size)


def turn(server: Serving, written: Written, *, records: bool) -> tuple[float, Written]:
    """(share of a core, what is written by now) of one turn."""
    if records:
        server.request("POST", "/api/recording")
    began, used = time.monotonic(), server.metric(CPU)
    time.sleep(TURN_S)
    took = time.monotonic() - began
    share = (server.metric(CPU) - used) / took
    if records:
        path = server.request("DELETE", "/api/recording")["path"]
        written = written.with_file(Path(str(path)), took)
    return share, written


def flown(server: Serving, minutes: float) -> tuple[list[Turns], Written]:
    """Lead, and take turns meanwhile."""
    written, shares = Written(), {False: list[float](), True: list[float]()}
    with leading(server):
        for k in range(2 * max(1, round(60.0 * minutes / (2.0 * TURN_S)))):
            records = k % 4 in (1, 2)
            share, written = turn(server, written, records=records)
            shares[records].append(share)
    names = {False: "no", True: "yes"}
    return [Turns(names[on], len(each), mean(each)) for on, each in shares.items()], written


def main() -> int:
    """Fly, tell, judge."""
    parser = Parser(prog="python -m tests.bench.bench_recording", description=__doc__)
    parser.add_argument("--minutes", type=number(0.5, 600.0), default=10.0)
    minutes = parser.parse_args().minutes
    with tempfile.TemporaryDirectory() as name, serving(Path(name)) as server:
        rows, written = flown(server, minutes)
    print(table(COLUMNS, rows))
    more = rows[1].share - rows[0].share
    rate = written.messages / written.seconds
    print(
        f"{more:.2%} of a core more, at most {MOST_SHARE:.0%}: {1e6 * more / rate:.0f} µs a message"
    )
    print(f"{rate:.0f} messages and {1e-6 * written.size / written.seconds:.2f} MB a second")
    return 0 if more <= MOST_SHARE else 1


if __name__ == "__main__":
    sys.exit(main())
