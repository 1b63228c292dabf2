"""`lightleash bench vision`: seeing, on films with known truth.

A film is drawn for each scene and size and sent through every channel; the live stages look at what
arrives. CPU times are this thread's. What is reported uses other seeds than those for tuning.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import sys
from collections.abc import Generator, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import cv2

from hardware.sim.camera_faults import CameraFault
from hardware.sim.scenes.scene import (
    FIRST_REPORTING_SEED,
    HD,
    SCENES,
    SIZES,
    SMALL_SIZES,
    HandMotion,
    Scene,
    Size,
    at_reference,
)
from hardware.sim.scenes.video import RenderedVideo
from pipeline.vision.visual_front_end import warm_up
from server.common.ranges import seed_number
from server.experiments import processes
from server.experiments.runner import make_folder
from server.experiments.vision import lies
from server.experiments.vision.channel import DEFAULT_CODECS, WITHOUT_IMU, Channel, channel
from server.experiments.vision.learning import LearningFigures, learn
from server.experiments.vision.picture import draw
from server.experiments.vision.rows import VisionRow, plain_values, row, text
from server.experiments.vision.verdicts import REFERENCE, verdicts, verdicts_on_learning
from server.experiments.vision.watch import SceneRecord, watch
from server.experiments.vision.write import write_film
from server.media.plots import drawn

FRAMES = 90
FILM_FRAMES, LONG_FILM_FRAMES = 45, 90
"""Of one film; more frames are more films. Who leaves and returns, or
has a twin, takes the longer ones."""
ALL_SIZES = (0, 0)  # no size


@dataclass(frozen=True, slots=True)
class Task:
    """One film through all channels."""

    scene: Scene
    size: Size
    seed: int
    frames: int
    channels: tuple[Channel, ...]
    plain: bool


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    sizes = [f"{w}x{h}" for w, h in (*SMALL_SIZES, *SIZES)]
    parser.add_argument("--frames", type=int, default=FRAMES, help="per scene, size, codec")
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--sizes", nargs="+", choices=sizes, default=sizes)
    parser.add_argument(
        "--codecs",
        nargs="+",
        default=[*DEFAULT_CODECS, "raw" + WITHOUT_IMU],
        metavar="CODEC",
        help="raw, jpeg, h264-MBIT, vp8-MBIT; with -noimu behind it: no motion sensors",
    )
    parser.add_argument("--seed", type=seed_number, default=0, help="of the first film")
    parser.add_argument(
        "--tuning", action="store_true", help=f"use the seeds below {FIRST_REPORTING_SEED}"
    )
    parser.add_argument(
        "--bare", action="store_true", help="robots without bodies: their LEDs float in the air"
    )
    parser.add_argument("--no-imu", action="store_true", help="no motion sensors at all")
    parser.add_argument("--no-plain", action="store_true", help="leave plain OpenCV out")
    parser.add_argument(
        "--learn", type=int, default=0, metavar="FILMS", help="of 20 s, for the readout and dates"
    )
    parser.add_argument(
        "--lies", type=int, default=0, metavar="FILMS", help="instead: of cameras that begin to lie"
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, metavar="DIR", help="figures as JSON and a picture")
    parser.add_argument(
        "--write", type=Path, metavar="DIR", help="only write each film's frames and readings"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure, print, draw; the exit code is 1 if a goal is not met."""
    if arguments.lies:
        return _lies(arguments)
    try:
        make_folder(arguments.out)
        tasks = list(_tasks(arguments))
    except ValueError as error:
        return _refused(error)
    try:
        return _measured(tasks, arguments)
    except OSError as error:
        return _refused(error)


def _refused(error: Exception) -> int:
    print(f"lightleash bench: {error}", file=sys.stderr)
    return 2


def _measured(tasks: list[Task], arguments: argparse.Namespace) -> int:
    """Look at all films, or write them.

    Raises:
        OSError: what comes of it can't be written.
    """
    if arguments.write is not None:
        return _write(tasks, arguments.write)
    records: dict[tuple[str, Size, str], SceneRecord] = {}
    pools: dict[tuple[str, str], SceneRecord] = {}
    for done, part in enumerate(watched(tasks, arguments.jobs), 1):
        _progress(done, len(tasks))
        for record in part:
            key = (record.scene, record.size, record.channel)
            records.setdefault(key, SceneRecord(*key)).add(record)
            pool = SceneRecord(record.scene, ALL_SIZES, record.channel)
            pools.setdefault((record.scene, record.channel), pool).add(record)
    learnt = [learn(tasks[0].seed + k) for k in range(arguments.learn)]
    pooled = [row(record) for record in pools.values()]
    return _report([row(record) for record in _sorted(records)], pooled, learnt, arguments.out)


def _lies(arguments: argparse.Namespace) -> int:
    """Watch films of cameras that lie; the exit code is 1 if an honest one is called a liar."""
    first = arguments.seed + (0 if arguments.tuning else FIRST_REPORTING_SEED)
    rows = []
    for fault in CameraFault:
        for codec in (name for name in arguments.codecs if not name.endswith(WITHOUT_IMU)):
            films = [lies.lied(fault, first + k, codec) for k in range(arguments.lies)]
            rows.append(lies.row(films))
    print(lies.text(rows))
    return int(any(one.before for one in rows))


def _report(
    rows: list[VisionRow], pools: list[VisionRow], learnt: list[LearningFigures], out: Path | None
) -> int:
    print(text([one for one in rows if one.frames]))
    floors = {one.height: f"{1e3 * one.pass_ms:.0f} µs" for one in rows if one.pass_ms > 0.0}
    durations = ", ".join(f"{height} rows {floor}" for height, floor in floors.items())
    print(f"\none pass over a picture: {durations}\n")
    judged = verdicts(rows, pools) + verdicts_on_learning(learnt)
    print("\n".join(map(str, judged)))
    if out is not None:
        goals = [{"goal": v.goal, "met": v.met, "found": v.found} for v in judged]
        films = [asdict(one) for one in learnt]
        values = {
            "rows": plain_values(rows),
            "all_sizes": plain_values(pools),
            "learnt": films,
            "verdicts": goals,
        }
        file = out / "vision.json"
        file.write_text(json.dumps(values, indent=1, ensure_ascii=False))
        files = [file, *drawn(lambda: [draw(rows, out / "vision.png")])]
        print(f"\nwritten: {', '.join(map(str, files))}")
    return 1 if any(verdict.met is False for verdict in judged) else 0


def _tasks(arguments: argparse.Namespace) -> Iterator[Task]:
    first = arguments.seed + (0 if arguments.tuning else FIRST_REPORTING_SEED)
    if not 0 <= arguments.seed < FIRST_REPORTING_SEED:
        raise ValueError(f"seed {arguments.seed}: allowed: 0 to {FIRST_REPORTING_SEED - 1}")
    if arguments.frames < 1 or arguments.jobs < 1:
        raise ValueError("frames and jobs: allowed: 1 or more")
    channels = [channel(name) for name in arguments.codecs]
    if arguments.no_imu:
        channels = [Channel(codec, False) for codec in dict.fromkeys(c.codec for c in channels)]
    for name in arguments.scenes:
        for size in SCENES[name].sizes:
            if "{}x{}".format(*size) not in arguments.sizes:
                continue
            # the goals are stated for one distance and size
            scene = (
                at_reference(SCENES[name]) if (name in REFERENCE and size == HD) else SCENES[name]
            )
            scene = replace(scene, has_body=not arguments.bare)
            is_long = scene.motion is HandMotion.LEAVING or scene.bar or scene.twin
            length = LONG_FILM_FRAMES if is_long else FILM_FRAMES
            for k, begin in enumerate(range(0, arguments.frames, length)):
                frames = min(length, arguments.frames - begin)
                yield Task(scene, size, first + k, frames, tuple(channels), not arguments.no_plain)


def watched(tasks: Iterable[Task], jobs: int) -> Generator[list[SceneRecord], None, None]:
    """What was seen in each film, by so many processes; closing it ends them at once."""
    if jobs == 1:
        yield from map(_watch, tasks)
        return
    yield from processes.each(_watch, tasks, jobs)


@cache
def _warm() -> None:
    """Once in each process."""
    cv2.setNumThreads(1)
    warm_up()


def _watch(task: Task) -> list[SceneRecord]:
    _warm()
    return watch(task.scene, task.size, task.seed, task.frames, list(task.channels), task.plain)


def _sorted(records: dict[tuple[str, Size, str], SceneRecord]) -> list[SceneRecord]:
    """Sort by scene as in the family, then size; channels as given."""
    order = list(SCENES)
    return sorted(records.values(), key=lambda r: (order.index(r.scene), r.size))


def _write(tasks: list[Task], out: Path) -> int:
    for done, task in enumerate(tasks, 1):
        film = RenderedVideo(task.scene, task.seed, task.size, task.frames)
        folder = out / f"{task.scene.name}-{task.size[0]}x{task.size[1]}-{task.seed}"
        write_film(film, folder)
        _progress(done, len(tasks))
    print(f"written: {len(tasks)} films in {out}")
    return 0


def _progress(done: int, of: int) -> None:
    if sys.stderr.isatty():
        bar = "#" * (40 * done // of)
        sys.stderr.write(f"\r[{bar:40}] {done} of {of}" + ("\n" if done == of else ""))
        sys.stderr.flush()
