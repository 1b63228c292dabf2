"""Kernels for every x86-64-v3 processor, as in the image, beside those for this very one.

    python -m tests.bench.bench_pinned [--rounds 5]

Both are compiled first; then processes take turns, each in another order. A tick is one of the
relative filter's at 200 Hz, a picture what the server's vision does with one of 720p, both in CPU
time of the thread; the figures are medians of each, and the ratio that of a round. The exit code is
1 if the median of the rounds misses the goal.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.options import Parser
from server.common.ranges import whole
from server.common.text import table

LEVELS: Final = {"native": "", "pinned": "x86-64-v3"}
"""By name: NUMBA_CPU_NAME."""
MOST_RATIO = 1.05
PICTURES = 200
COLUMNS: Final = (
    ("round", "round", "{}"),
    ("native_tick_us", "tick, native µs", "{:.1f}"),
    ("tick_ratio", "pinned ÷ native", "{:.3f}"),
    ("native_picture_us", "picture, native µs", "{:.0f}"),
    ("picture_ratio", "pinned ÷ native", "{:.3f}"),
)
MEASURE = "from tests.bench.bench_pinned import measured; print(measured())"


@dataclass(frozen=True, slots=True)
class Round:
    """One process of each, beside each other."""

    round: int
    native_tick_us: float
    tick_ratio: float
    native_picture_us: float
    picture_ratio: float


def measured() -> str:
    """JSON: CPU time of a tick and of a picture [µs], in this process."""
    from hardware.sim.scenes.scene import HD, SCENES
    from server.experiments.vision.channel import Channel
    from server.experiments.vision.watch import watch
    from tests.bench.bench_relative import flown

    _, _, quiet, _ = flown()
    records = watch(SCENES["typical"], HD, 7, PICTURES, [Channel("raw")], plain=False)
    return json.dumps([median(quiet), 1e6 * median(records[0].whole_s)])


def run(command: list[str], folder: Path, level: str) -> str:
    """What a process prints whose kernels are of a level."""
    own = {"NUMBA_CPU_NAME": LEVELS[level], "NUMBA_CACHE_DIR": str(folder / level)}
    return subprocess.run(
        [sys.executable, *command],
        env={**os.environ, **own},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout


def main() -> int:
    """Compile, take turns, print a row for each round and the median."""
    parser = Parser(description=__doc__)
    parser.add_argument("--rounds", type=whole(1, 99), default=5)
    count = parser.parse_args().rounds
    rows = []
    with TemporaryDirectory() as name:
        for level in LEVELS:
            run(["-m", "server", "warm"], Path(name), level)
        for k in range(count):
            order = list(LEVELS) if k % 2 == 0 else list(LEVELS)[::-1]
            cost = {level: json.loads(run(["-c", MEASURE], Path(name), level)) for level in order}
            tick, picture = cost["native"]
            ratios = cost["pinned"][0] / tick, cost["pinned"][1] / picture
            rows.append(Round(k, tick, ratios[0], picture, ratios[1]))
    print(table(COLUMNS, rows))
    ratios = median(row.tick_ratio for row in rows), median(row.picture_ratio for row in rows)
    print(f"pinned ÷ native: tick {ratios[0]:.3f}, picture {ratios[1]:.3f}; goal {MOST_RATIO}")
    return 0 if max(ratios) <= MOST_RATIO else 1


if __name__ == "__main__":
    sys.exit(main())
