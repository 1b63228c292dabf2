"""Real flights in slow motion where a machine is too weak for them in real time.

    python -m tests.slow_motion pytest -m flight                # so slow as this machine needs it
    python -m tests.slow_motion --factor 2 pytest -m flight     # each of their seconds takes 2

A flight's browser, server, robot and pictures share two processors, which on a weak machine are
too few, and then it proves nothing. Here all of them are what they always are, with their clocks,
sleeps and timeouts slowed down together (`slow_motion.c`, of Linux alone): a machine as strong as
is wanted, for as long as it takes.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from server.common.ranges import number
from tests.machine import SLOW_MOTION, slowness

SOURCE = Path(__file__).with_suffix(".c")
COMPILE: Final = ("gcc", "-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")
SINCE: Final = "SLOW_MOTION_SINCE"
ENOUGH: Final = 1.5
"""So many times as long work may take: then flights leave a quarter of two processors."""
LOOKS, MOST_SHARE = 20, 0.9
"""At each processor: a neighbour comes and goes within seconds; and of all of them so many may take
no longer, for one alone tells of nothing that lasts."""


def _looks(_: int) -> list[float]:
    return [slowness() for _ in range(LOOKS)]


def needed_factor() -> float:
    """So that work takes no longer than is `ENOUGH`, with all processors at work; at least 1."""
    count = os.cpu_count() or 1
    with ProcessPoolExecutor(count) as pool:
        looks = [look for looks in pool.map(_looks, range(count)) for look in looks]
    return max(1.0, round(float(np.quantile(looks, MOST_SHARE)) / ENOUGH, 1))


def _lacks() -> str:
    """Why this machine knows no slow motion, or ""."""
    if sys.platform != "linux":
        return "of Linux alone"
    return "" if shutil.which(COMPILE[0]) else f"{COMPILE[0]} is missing"


def environment(factor: float, folder: Path) -> dict[str, str]:
    """Of processes that live `factor` times as slowly, from now on; what they load is in `folder`.

    Raises:
        subprocess.CalledProcessError: the compiler refuses the source.
    """
    library = folder / "slow_motion.so"
    subprocess.run([*COMPILE, "-o", str(library), str(SOURCE)], check=True)
    since = f"{time.time_ns()} {time.monotonic_ns()}"
    return {**os.environ, "LD_PRELOAD": str(library), SLOW_MOTION: f"{factor:.1f}", SINCE: since}


def main() -> int:
    """Run a command; gives its exit status."""
    parser = argparse.ArgumentParser(prog="tests.slow_motion", description=__doc__)
    parser.add_argument(
        "--factor", type=number(1.0, 20.0), help="in place of what this machine needs"
    )
    parser.add_argument("command", nargs=argparse.REMAINDER)
    asked = parser.parse_args()
    slower = asked.factor or needed_factor()
    if slower > 1.0 and (why := _lacks()):
        print(f"!!! IN REAL TIME, not {slower:.1f} times as slowly: {why}", file=sys.stderr)
        slower = 1.0
    if slower == 1.0:
        return subprocess.run(asked.command).returncode
    print(f"in slow motion: each second of it takes {slower:.1f}", flush=True)
    with TemporaryDirectory() as folder:
        return subprocess.run(asked.command, env=environment(slower, Path(folder))).returncode


if __name__ == "__main__":
    sys.exit(main())
