"""STOP while a stranger floods the robot's port: how long until there is no thrust, many times.

    python -m tests.bench.bench_stop [--stops 1000] [--robots python,c]

In the robot's own ticks, from its newest sample when STOP was first said to its first one without
thrust. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from hardware.contract import FollowerContract
from server.common.options import Parser
from tests.bench.judgement import verdict
from tests.e2e.robot_rig import (
    compiled_watchdog,
    connect,
    priority,
    simulated_robot,
    watchdog_robot,
)
from tests.e2e.stranger import MOST_TICKS, TICK_S, ended, flooding, ticks_to_stop, what_it_got

ROBOTS: Final = ("python", "c")


def flooded(robot: str, stops: int) -> tuple[Sequence[int], int]:
    """(ticks of each STOP, samples that the stranger got)."""
    with tempfile.TemporaryDirectory() as folder, priority():
        path = Path(folder)
        rig = watchdog_robot(compiled_watchdog(path)) if robot == "c" else simulated_robot()
        stranger = flooding(rig, path)
        try:
            rig.follower = connect(rig.port, epoch=30)
            FollowerContract().ready(rig)
            return ticks_to_stop(rig, stops), what_it_got(stranger)
        finally:
            ended(stranger)
            rig.close()


def goals(robot: str, ticks: Sequence[int], got: int) -> Iterator[tuple[bool, str]]:
    """(met, words) of each."""
    p50, p99, most = (1e3 * TICK_S * float(np.quantile(ticks, q)) for q in (0.5, 0.99, 1.0))
    words = f"{robot}: STOP p50 {p50:.0f} ms, p99 {p99:.0f} ms, most {most:.0f} ms of {len(ticks)}"
    limit_ms = 1e3 * TICK_S * MOST_TICKS
    yield p99 <= limit_ms, f"{words}; p99 at most {limit_ms:.0f} ms"
    yield got == 0, f"{robot}: samples that the stranger got: {got}"


def _robots(text: str) -> list[str]:
    names = text.split(",")
    if not set(names) <= set(ROBOTS):
        raise argparse.ArgumentTypeError(f"{text}: allowed: {', '.join(ROBOTS)}, with commas")
    return names


def main() -> int:
    """Stop, tell, judge."""
    parser = Parser(prog="python -m tests.bench.bench_stop", description=__doc__)
    parser.add_argument("--stops", type=int, default=1_000, help="of each robot")
    parser.add_argument("--robots", type=_robots, default=list(ROBOTS), metavar=",".join(ROBOTS))
    told = parser.parse_args()
    judgement = [
        goal for robot in told.robots for goal in goals(robot, *flooded(robot, told.stops))
    ]
    return verdict(judgement)


if __name__ == "__main__":
    sys.exit(main())
