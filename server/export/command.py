"""`lightleash export`: a recording in a format that others read."""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from server.common.options import Parser
from server.export.decoded import DecodedRecording
from server.export.episodes import Episode, episodes
from server.recording.reader import read
from server.recording.writer import RecordingError

EXTRA = "install Lightleash with its extra `export`"
Write = Callable[[DecodedRecording, Sequence[Episode], Path], str]
ABOUT = """Write a recording in a format that others read. The recording stays as it is.

  foxglove  one MCAP file for Foxglove, Lichtblick or Rerun: film, poses, motion, LEDs, log
  rosbag2   a bag (MCAP inside) for ROS 2, film as foxglove_msgs/CompressedVideo
  lerobot   a LeRobotDataset v3.0: each press an episode, each picture a row with its true times
  csv       plain tables, units in the names of the columns

Times are those at which things happened: of a picture, when it was taken. A recording by an older
Lightleash doesn't know the day: its export begins in 1970."""


def _foxglove() -> tuple[Write, str]:
    from server.export.foxglove import write

    return write, ".foxglove.mcap"


def _rosbag2() -> tuple[Write, str]:
    from server.export.rosbag import write

    return write, ".rosbag2"


def _lerobot() -> tuple[Write, str]:
    from server.export.lerobot import write

    return write, ".lerobot"


def _csv() -> tuple[Write, str]:
    from server.export.csv_tables import write

    return write, ".csv"


FORMATS: dict[str, Callable[[], tuple[Write, str]]] = {
    "foxglove": _foxglove,
    "rosbag2": _rosbag2,
    "lerobot": _lerobot,
    "csv": _csv,
}
"""How to write each, and how the name ends of the file or folder that it becomes."""


def _numbers(text: str) -> frozenset[int]:
    return frozenset(int(word) for word in text.split(","))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="lightleash export",
        description=ABOUT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("recording", type=Path)
    parser.add_argument("--to", choices=FORMATS, default="foxglove")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="made if missing")
    parser.add_argument("--task", default="", help="what episodes are for that name none")
    parser.add_argument(
        "--discard",
        type=_numbers,
        default=frozenset(),
        metavar="N,N",
        help="others nobody should learn from, from 0",
    )
    return parser


@contextmanager
def _whole(place: Path) -> Iterator[None]:
    """What is there of a file or folder that did not get to its end is removed again."""
    try:
        yield
    except BaseException:
        if place.is_dir():
            shutil.rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)
        raise


def _run(arguments: argparse.Namespace) -> str:
    """Do what is asked; gives lines about it."""
    write, suffix = FORMATS[arguments.to]()
    decoded = DecodedRecording(read(arguments.recording))
    found = episodes(decoded.items(), arguments.task, arguments.discard)
    place: Path = arguments.out / f"{arguments.recording.stem}{suffix}"
    if place.exists():
        raise FileExistsError(f"{place} is there already: name another --out")
    arguments.out.mkdir(parents=True, exist_ok=True)
    with _whole(place):
        said = f"{place}: {write(decoded, found, place)}"
    if decoded.zero_ns is None:
        said += "\nThe recording doesn't know the day: its clock's 0 is shown as 1970."
    return said


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; gives the exit status."""
    try:
        print(_run(_parser().parse_args(argv)))
    except ModuleNotFoundError as error:
        print(f"lightleash export: {error.name} is missing: {EXTRA}", file=sys.stderr)
        return 1
    except (RecordingError, OSError) as error:
        print(f"lightleash export: {error}", file=sys.stderr)
        return 1
    return 0
