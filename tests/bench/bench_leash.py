"""Random hands that lead the AMES beyond its reach, stay there and come back, in virtual time.

    python -m tests.bench.bench_leash [--hands 1000] [--workers 2]

Each goes 0.3 to 0.45 m away in 1.5 to 3 s. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from pipeline.config import TeleopConfig
from pipeline.signals import Mode
from server.common.options import Parser
from server.common.progress import progress_bar
from server.common.ranges import whole
from server.experiments import processes
from tests.server.simulation.beyond_reach import MOST_AT_LIMIT_S, TOLD_S, BeyondFlight, beyond

FIRST_SEED: Final = 1000
"""Those before were used to find out what to keep."""


def flown(seed: int) -> BeyondFlight:
    """One hand, on the leash."""
    return beyond(seed, TeleopConfig())


def spread(values: list[float], unit: str) -> str:
    """Median, p99 and the most."""
    p50, p99, most = np.percentile(values, (50.0, 99.0, 100.0))
    return f"p50 {p50:.3g}, p99 {p99:.3g}, most {most:.3g} {unit}"


def main() -> int:
    """Fly, print, judge."""
    parser = Parser(prog="bench_leash", description=__doc__)
    parser.add_argument("--hands", type=whole(1, 100_000), default=1000)
    parser.add_argument("--workers", type=whole(1, 256), default=processes.cores())
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.hands)
    flights: list[BeyondFlight] = []
    with progress_bar(len(seeds), "hands") as bar:
        for flight in processes.each(flown, seeds, arguments.workers):
            flights.append(flight)
            bar.update()
    full_s = [flight.at_f_max_s for flight in flights]
    late_s = [flight.told_late_s for flight in flights]
    ended = [flight.left for flight in flights if flight.left or flight.modes != {Mode.TRACK}]
    at_limit = sum(one > MOST_AT_LIMIT_S for one in full_s)
    said_late = sum(one > TOLD_S for one in late_s)
    print(f"{len(flights)} hands that go 0.3 to 0.45 m away")
    print(f"longest that a thruster was at its limit: {spread(full_s, 's')}")
    print(f"told after the reference left the reach: {spread(late_s, 's')}")
    print(f"from the reference, once back: {spread([one.back_mm for one in flights], 'mm')}")
    goals = {
        f"no flight ended: {len(ended)} {sorted(set(ended))}": not ended,
        f"no thruster at its limit for more than {MOST_AT_LIMIT_S} s: {at_limit}": at_limit == 0,
        f"told within {TOLD_S} s: {said_late} later": said_late == 0,
    }
    for words, is_met in goals.items():
        print(f"{'met    ' if is_met else 'NOT MET'} {words}")
    return 0 if all(goals.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
