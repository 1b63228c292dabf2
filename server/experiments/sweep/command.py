"""The command: read, fly what is missing, keep it as it comes, tell and draw."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from pathlib import Path

from server.common.clock import now
from server.common.errors import InputError
from server.common.progress import progress_bar
from server.common.ranges import whole
from server.experiments.processes import cores
from server.experiments.sweep import picture, summary
from server.experiments.sweep.errors import SweepError
from server.experiments.sweep.results import SweepResults
from server.experiments.sweep.sweep_file import Sweep, examples, read
from server.experiments.sweep.workers import on_cluster, on_processes
from server.media.plots import drawn
from server.simulation.session import SessionOutcome, SweepSession
from server.simulation.sweep_keys import Number, Switch, Word, known_keys

INTERRUPTED, KILLED = 130, 3  # exit codes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    given = f"what to sweep; given with the project: {', '.join(examples())}"
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE.toml", help=given)
    parser.add_argument("--out", type=Path, help="folder; default: called as the file, beside it")
    parser.add_argument("--workers", type=whole(1, 1024), help="processes; default: one a core")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, to fly there")
    parser.add_argument("--mix", action="store_true", help="go on with what other code has begun")
    parser.add_argument("--keys", action="store_true", help="list what can be swept, and stop")


def run(arguments: argparse.Namespace) -> int:
    """Fly; 0 if all is done, 130 after Ctrl-C, 2 if it can't be flown, 3 if a worker was killed."""
    if arguments.keys:
        print("\n".join(_listed()))
        return 0
    try:
        if arguments.file is None:
            raise SweepError("FILE.toml", "is missing; --keys lists what it may sweep")
        if arguments.scheduler and arguments.workers:
            raise SweepError("--workers", "not with --scheduler, whose cluster has its own")
        sweep = read(examples().get(str(arguments.file), arguments.file))
        folder = arguments.out or arguments.file.with_suffix("")
        with SweepResults(folder, sweep, arguments.mix) as results:
            return _flown(sweep, results, folder, arguments)
    except (SweepError, InputError, OSError) as error:
        print(f"lightleash experiments sweep: {error}", file=sys.stderr)
        return 2


def _flown(sweep: Sweep, results: SweepResults, folder: Path, arguments: argparse.Namespace) -> int:
    sessions = sweep.sessions()
    missing = [session for session in sessions if session.index not in results.done]
    already = f", {len(results.done)} of them done before" if results.done else ""
    print(f"{len(sessions)} sessions of {sweep.seconds:g} s: {len(sweep.points)} settings", end="")
    print(f" × {len(sweep.seeds)} seeds{already}", flush=True)
    if results.mixed:
        print("MIXED: some of them were flown by other code or libraries, see sweep.json")
    hands = arguments.scheduler or f"{arguments.workers or cores()} processes"
    results.write(sys.argv, hands)
    started, cpu_s = now(), results.cpu_s
    code = _fill(results, missing, arguments, len(sessions)) if missing else 0
    results.write(sys.argv, hands)
    if missing:
        print(
            f"{len(results.done)} sessions; now {results.cpu_s - cpu_s:.1f} CPU-seconds "
            f"by {hands} in {now() - started:.1f} s"
        )
    pictures: Sequence[Path] = ()
    if results.done:
        print(summary.table(sweep, results.done))
        pictures = drawn(lambda: [picture.draw(sweep, results.done, folder / "sweep.png")])
    names = ["results.csv", "sweep.json", *(path.name for path in pictures)]
    print(f"written: {folder}/{', '.join(names)}")
    return code


def _fill(
    results: SweepResults, missing: list[SweepSession], arguments: argparse.Namespace, total: int
) -> int:
    """Fly what is missing; whatever stops it, what is done stays."""
    bar = progress_bar(total, "sessions", total - len(missing))
    try:
        with closing(_outcomes(missing, arguments)) as outcomes:
            for outcome in outcomes:
                results.add(outcome)
                bar.update()
    except KeyboardInterrupt:
        return _stopped("interrupted", INTERRUPTED)
    except BrokenProcessPool:
        return _stopped("a worker process was killed (out of memory?)", KILLED)
    finally:
        bar.close()
    return 0


def _stopped(why: str, code: int) -> int:
    print(f"\n{why}: the same command goes on from here", file=sys.stderr)
    return code


def _outcomes(
    missing: list[SweepSession], arguments: argparse.Namespace
) -> Generator[SessionOutcome, None, None]:
    if arguments.scheduler:
        return on_cluster(missing, arguments.scheduler)
    return on_processes(missing, min(arguments.workers or cores(), len(missing)))


def _listed() -> Iterator[str]:
    """Every key with what it may be."""
    for key, allowed in known_keys(("NAME OF A GAIN SET",)).items():
        match allowed:
            case Number() | Word() | Switch():
                what = allowed.says_no(None)
            case _:
                what = "as in a robot file"
        yield f"{key}  {what}"
