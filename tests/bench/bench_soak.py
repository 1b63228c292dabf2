"""Does a server that is used for hours grow? Flights by turns over each path, and what they leave.

    python -m tests.bench.bench_soak [--minutes 120] [--flight 60] [--samples FILE.csv]

Virtual phones come, lead the simulated robot for a while and leave; a supervisor watches, records
some of them. Memory, open files, threads and children of each process are read between flights,
when nobody leads. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import contextlib
import csv
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import cycle
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from server.common.options import Parser
from server.common.text import table
from tests.bench.judgement import verdict
from tests.e2e.flight_log import FlightLog
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import processes

PATHS: Final = (
    ("--path", "websocket", "--codec", "h264"),
    ("--path", "webrtc"),
    ("--path", "websocket", "--codec", "jpeg"),
)
RECORDED_EVERY = 3
SETTLE_S, LEAVE_S, PATIENCE_S = 3.0, 20.0, 60.0
WARM = 0.25
"""Of the run is not judged: caches and pools fill."""
MOST_MB_PER_H, MOST_FILES = 1.0, 0.0
AT_REST = ("DISARMED", "STOPPED")
COLUMNS: Final = (
    ("process", "process", "{}"),
    ("begins_mb", "RSS MB", "{:.1f}"),
    ("slope_mb_h", "MB/h", "{:+.2f}"),
    ("sigma_mb_h", "±", "{:.2f}"),
    ("files", "files +", "{:+.0f}"),
    ("threads", "threads +", "{:+.0f}"),
    ("children", "children +", "{:+.0f}"),
)
"""Files, threads, children: the median of the judged part's last third over that of its first."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One process between two flights."""

    t: float
    """Since the first [s]."""
    process: str
    pid: int
    rss_mb: float
    files: int
    threads: int
    children: int


@dataclass(frozen=True, slots=True)
class Growth:
    """One process over the judged part."""

    process: str
    begins_mb: float
    slope_mb_h: float
    sigma_mb_h: float
    """Standard error of the slope, as if the samples were independent."""
    files: float
    threads: float
    children: float
    deaths: int


def sampled(server: Serving, t: float) -> Iterator[Sample]:
    """What each process holds now."""
    everybody = processes(server.process.pid) | {"launcher": server.process.pid}
    for name, pid in everybody.items():
        proc = Path(f"/proc/{pid}")
        lines = dict(line.split(":", 1) for line in (proc / "status").read_text().splitlines())
        yield Sample(
            t,
            name,
            pid,
            int(lines["VmRSS"].split()[0]) / 1024.0,
            len(list((proc / "fd").iterdir())),
            int(lines["Threads"]),
            sum(len(task.read_text().split()) for task in proc.glob("task/*/children")),
        )


def growth(samples: Sequence[Sample]) -> list[Growth]:
    """Of each process, in the part that is judged."""
    end = max(sample.t for sample in samples)
    return [
        _growth([one for one in samples if one.process == name and one.t >= WARM * end])
        for name in dict.fromkeys(sample.process for sample in samples)
    ]


def _growth(judged: Sequence[Sample]) -> Growth:
    t_h = np.array([one.t for one in judged]) / 3600.0
    rss = np.array([one.rss_mb for one in judged])
    A = np.column_stack((np.ones_like(t_h), t_h))
    fitted, *_ = np.linalg.lstsq(A, rss)
    residual = rss - A @ fitted
    spread = np.sqrt(np.sum((t_h - t_h.mean()) ** 2))
    sigma = np.sqrt(residual @ residual / max(len(judged) - 2, 1)) / spread
    third = max(len(judged) // 3, 1)

    def gained(name: str) -> float:
        values = [getattr(one, name) for one in judged]
        return float(np.median(values[-third:]) - np.median(values[:third]))

    return Growth(
        judged[0].process,
        float(rss[0]),
        float(fitted[1]),
        float(sigma),
        gained("files"),
        gained("threads"),
        gained("children"),
        len({one.pid for one in judged}) - 1,
    )


def fly(server: Serving, options: Sequence[str], seconds: float) -> bool:
    """One phone comes, leads, leaves; whether the robot followed it."""
    command = [sys.executable, "-m", "server", "phone", "--hand", "moving", *options]
    with contextlib.closing(FlightLog(server)) as log:
        with contextlib.suppress(subprocess.TimeoutExpired):  # it is killed, and did not follow
            subprocess.run(
                [*command, "--seconds", str(seconds)],
                env=server.environment,
                stdout=subprocess.DEVNULL,
                timeout=seconds + PATIENCE_S,
                check=False,
            )
        end = time.monotonic() + LEAVE_S
        while server.request("GET", "/api/status")["mode"] not in AT_REST:
            if time.monotonic() > end:
                break
            time.sleep(0.2)
        return any(said.mode == "TRACK" for said in log.said)


def soak(minutes: float, flight_s: float) -> tuple[list[Sample], int, int]:
    """Samples, flights that followed, all flights."""
    samples: list[Sample] = []
    followed = flown = 0
    with tempfile.TemporaryDirectory() as folder, serving(Path(folder)) as server:
        began = time.monotonic()
        for n, options in enumerate(cycle(PATHS)):
            if time.monotonic() > began + 60.0 * minutes:
                break
            records = n % RECORDED_EVERY == 0
            if records:
                server.request("POST", "/api/recording")
            followed += fly(server, options, flight_s)
            flown += 1
            if records:
                server.request("DELETE", "/api/recording")
            time.sleep(SETTLE_S)
            read = list(sampled(server, time.monotonic() - began))
            samples += read
            sizes = ", ".join(f"{one.process} {one.rss_mb:.1f}" for one in read)
            print(f"{flown} flights, {followed} followed; MB: {sizes}", file=sys.stderr, flush=True)
    return samples, followed, flown


def goals(rows: Sequence[Growth], followed: int, flown: int) -> Iterator[tuple[bool, str]]:
    """(met, words) of each."""
    yield followed == flown, f"{followed} of {flown} flights followed"
    for row in rows:
        words = f"{row.process}: {row.slope_mb_h:+.2f} ± {row.sigma_mb_h:.2f} MB/h"
        yield row.slope_mb_h <= MOST_MB_PER_H, f"{words}, at most {MOST_MB_PER_H:g}"
        held = max(row.files, row.threads, row.children)
        yield held <= MOST_FILES, f"{row.process}: files, threads, children {held:+.0f}"
        yield row.deaths == 0, f"{row.process}: {row.deaths} deaths"


def main() -> int:
    """Soak, tell, judge."""
    parser = Parser(prog="python -m tests.bench.bench_soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--flight", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--samples", type=Path, help="keep what was read, as CSV")
    given = parser.parse_args()
    samples, followed, flown = soak(given.minutes, given.flight)
    if given.samples is not None:
        with given.samples.open("w", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Sample)])
            writer.writeheader()
            writer.writerows(map(asdict, samples))
    rows = growth(samples)
    print(table(COLUMNS, rows))
    return verdict(goals(rows, followed, flown))


if __name__ == "__main__":
    sys.exit(main())
