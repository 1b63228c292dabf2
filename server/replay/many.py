"""Many recordings through the pipeline alone, each by one of a cluster's workers.

A folder is filled: NAME.csv   the table of one recording, as it comes
                   replays.csv a recording a line, in their order; what failed says why
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.common import clock
from server.common.cluster import workers
from server.common.cluster.workers import Failure
from server.common.errors import InputError
from server.common.progress import progress_bar
from server.recording.reader import read
from server.recording.writer import RecordingError
from server.replay.offline import ReplayCounts, write_table

SUMMARY: Final = "replays.csv"
COLUMNS: Final = ("recording", "pictures", "found", "refused", "cpu_s", "error")


@dataclass(frozen=True, slots=True)
class Replayed:
    """What came of one recording."""

    counts: ReplayCounts
    cpu_s: float
    table: str
    """CSV."""
    error: str = ""
    """Why it ended early or did not begin, or ""."""


def recordings_in(paths: Sequence[Path]) -> list[Path]:
    """The recordings that are named, and those of each folder that is named, sorted by name.

    Raises:
        InputError: a folder has none, or two would have one table.
    """
    found: dict[str, Path] = {}
    for path in paths:
        inside = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise InputError(path, "", "holds no recording; allowed: a folder with *.mcap")
        for one in map(Path.absolute, inside):
            other = found.setdefault(one.stem, one)
            if other != one:
                why = f"would have the same table as {other}; allowed: one recording of a name"
                raise InputError(one, "", why)
    return list(found.values())


def replayed(path: str) -> Replayed:
    """One recording, by whoever is asked. One that can't be replayed is an outcome, too."""
    started, file, counts, error = clock.process_cpu(), io.StringIO(newline=""), ReplayCounts(), ""
    try:
        write_table(read(Path(path)), file, counts)
    except RecordingError as fault:
        error = str(fault)
    return Replayed(counts, clock.process_cpu() - started, file.getvalue(), error)


class ReplayResults:
    """A folder with what came of recordings."""

    def __init__(self, folder: Path, recordings: Iterable[Path]) -> None:
        """Nothing is done yet.

        Raises:
            OSError: it can't be written.
        """
        self._folder, self._recordings = folder, list(recordings)
        self.done: dict[str, Replayed] = {}
        folder.mkdir(parents=True, exist_ok=True)
        self.write()

    def add(self, path: str, outcome: Replayed | Failure) -> None:
        """Another one is done."""
        if isinstance(outcome, Failure):
            outcome = Replayed(ReplayCounts(), 0.0, "", outcome.words)
        self.done[path] = outcome
        if outcome.table:
            name = Path(path).with_suffix(".csv").name
            (self._folder / name).write_text(outcome.table, encoding="utf-8", newline="")

    @property
    def failed(self) -> int:
        """How many of them did not get to their end."""
        return sum(bool(one.error) for one in self.done.values())

    @property
    def cpu_s(self) -> float:
        """CPU time of all [s]."""
        return sum(one.cpu_s for one in self.done.values())

    def write(self) -> None:
        """A line for each one that is done."""
        with (self._folder / SUMMARY).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS)
            for path in map(str, self._recordings):
                if (one := self.done.get(path)) is not None:
                    counts = (one.counts.pictures, one.counts.found, one.counts.refused)
                    writer.writerow((path, *counts, f"{one.cpu_s:.3f}", one.error))


def replay_all(recordings: Sequence[Path], address: str, results: ReplayResults) -> None:
    """Replay them all by the workers of the Dask scheduler at `address`.

    Whatever stops it, what is done stays.

    Raises:
        InputError: no Dask here, no scheduler or workers there, or workers unlike this machine.
        OSError: the folder can't be written.
    """
    bar = progress_bar(len(recordings), "recordings")
    try:
        with closing(workers.each(replayed, map(str, recordings), address)) as outcomes:
            for path, outcome in outcomes:
                results.add(path, outcome)
                bar.update()
    finally:
        bar.close()
        results.write()
