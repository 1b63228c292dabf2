"""Recordings replayed by a local Dask cluster of one worker and of two: how much quicker two are.

    python -m tests.bench.bench_replays [--recordings 200]

The clusters take turns, and each clock runs from the first recording given out to the last table
written, workers started and warm. Beside each stands for how much of that time the kernel says that
somebody waited for a processor: a ratio means something where one worker's is near zero. The exit
code is 1 if the goal is missed.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from server.common.clock import now
from server.common.cluster.workers import local_cluster
from server.common.options import Parser
from server.common.ranges import whole
from server.common.text import table
from server.replay.many import ReplayResults, recordings_in, replay_all

FLIGHT = Path(__file__).parents[1] / "data" / "virtual_phone.mcap"
LEAST_RATIO = 1.8
COLUMNS = (
    ("workers", "workers", "{}"),
    ("took_s", "s", "{:.1f}"),
    ("cpu_s", "CPU-s", "{:.1f}"),
    ("waited_s", "somebody waited, s", "{:.1f}"),
)
PRESSURE = Path("/proc/pressure/cpu")


def waited_s() -> float:
    """For how long somebody has waited for a processor since the machine started [s]."""
    return 1e-6 * int(PRESSURE.read_text().split("total=")[1].split()[0])


@dataclass(frozen=True, slots=True)
class Row:
    """What a cluster took for all recordings."""

    workers: int
    took_s: float = 0.0
    cpu_s: float = 0.0
    waited_s: float = 0.0

    def with_those(self, recordings: list[Path], out: Path) -> Row:
        """And for these."""
        with local_cluster(self.workers) as address:
            first = recordings[: 2 * self.workers]  # each worker loads what it works with
            replay_all(first, address, ReplayResults(out, first))
            results, started, waited = ReplayResults(out, recordings), now(), waited_s()
            replay_all(recordings, address, results)
            took_s, waiting_s = now() - started, waited_s() - waited
        if results.failed or len(results.done) != len(recordings):
            raise RuntimeError(f"{results.failed} recordings failed, see {out}")
        cpu_s, waiting_s = self.cpu_s + results.cpu_s, self.waited_s + waiting_s
        return Row(self.workers, self.took_s + took_s, cpu_s, waiting_s)


def main() -> int:
    """Replay, print a row for each cluster and the ratio."""
    parser = Parser(description=__doc__)
    parser.add_argument("--recordings", type=whole(4, 10_000), default=200)
    count = parser.parse_args().recordings
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(count):
            (folder / f"{k:05d}.mcap").symlink_to(FLIGHT)
        recordings = recordings_in([folder])
        halves = recordings[: count // 2], recordings[count // 2 :]
        rows = {workers: Row(workers) for workers in (1, 2)}
        for half, order in zip(halves, ((1, 2), (2, 1)), strict=True):
            for workers in order:
                rows[workers] = rows[workers].with_those(half, folder / "out")
    print(table(COLUMNS, rows.values()))
    ratio = rows[1].took_s / rows[2].took_s
    print(f"{count} recordings: two workers are {ratio:.2f} times one, goal {LEAST_RATIO}")
    return 0 if ratio >= LEAST_RATIO else 1


if __name__ == "__main__":
    sys.exit(main())
