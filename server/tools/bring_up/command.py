"""`lightleash robot bring-up`: which thruster is which, and what is the robot? It hangs meanwhile.

One thruster after the other gives short pulses, a tenth of its thrust at most, and the robot's own
motion sensors say what that does. Thrusters that are exchanged or push the other way and sensors
that sit turned are named; then mass, inertia, suspension, lag and thrusters are found, each with
its interval, and written into a new file. The robot is reached as it is in flight, by the same
link, key and watchdog, and all of it is recorded.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees
from pathlib import Path
from typing import Final

from hardware.follower import Follower
from hardware.link.link_key import new_key
from hardware.link.registry import connect, link_kind
from hardware.robot_file import RobotFile, is_shipped, load_robot, robot_of, robot_path
from hardware.robot_text import (
    RobotTextError,
    with_intervals,
    with_numbers,
    with_thrusters_reordered,
)
from pipeline.config import PERIOD_S
from server.common import clock
from server.common.ranges import MOST_PORT, number, whole
from server.common.runtime import whole_new_file
from server.common.settings import state_directory
from server.common.text import Column, dashed, table
from server.control import realtime
from server.control.process import unfit
from server.control.robot_clock import RobotLink
from server.control.robot_epoch import next_epoch
from server.export.decoded import DecodedRecording, RecordedState
from server.process.robot_claim import claimed_robot
from server.process.robot_key import epoch_file, key_of
from server.recording.folder import RecordingFolder
from server.recording.reader import read
from server.recording.writer import DEVICE_KEY, ROBOT_KEY, Recorder
from server.tools.bring_up import session
from server.tools.bring_up.findings import BroughtUp, brought_up, periods
from server.tools.bring_up.pulses import (
    CHIRP_S,
    MOST_SHARE,
    PAUSE_S,
    STILL_S,
    BringUpError,
    PulseProgramme,
)
from server.tools.identify.command import COLUMNS, PER_MASS
from server.tools.identify.findings import file_intervals, file_numbers

HELP = "Which thruster is which, and what is the robot? It hangs, and gives short pulses."
UNKNOWN_ROPE: Final = """\
Its thrusters are as its file says. Nothing is written: the file doesn't know what it hangs from
now, so its numbers come from flights (lightleash robot identify)."""
RECORDINGS: Final = "bring-up"
CHECKLIST: Final = """\
{name} will turn its {count} thrusters one after the other, up to {level:.2f} N of {f_max:g} N each.
  * it hangs freely, nothing and nobody within its reach, and can turn;
  * one person stands at the power cut or emergency stop, and looks at the robot;
  * another one is here: Ctrl-C stops it at once.
It takes about {seconds:.0f} s."""
THRUSTERS: Final[tuple[Column, ...]] = (
    ("number", "told", "{}"),
    ("is_which", "turns the file's", "{}"),
    ("gives", "gives ×", "{:.3f}"),
    ("gives_95", "± 95 %", "{:.2g}"),
    ("lag_ms", "lag ms", "{:.1f}"),
    ("lag_95_ms", "± 95 %", "{:.1f}"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = parser.add_argument
    add("robot", metavar="FILE", help="name or .toml")
    add("--out", type=Path, metavar="FILE.toml", help="default: FILE-brought-up.toml, beside FILE")
    add("--confirm", metavar="NAME", help="the robot's name: it hangs, somebody is at the stop")
    add(
        "--hung", action="store_true", help="a robot that flies or stands: it hangs from a rope now"
    )
    add(
        "--percent",
        type=number(1.0, 100.0 * MOST_SHARE),
        default=100.0 * MOST_SHARE,
        help="of a thruster's largest thrust; default: %(default)g, and never more",
    )
    add("--host", help="of the robot; default: the robot file's")
    add("--port", type=whole(1, MOST_PORT), help="likewise")
    add("--state", type=Path, default=state_directory(), help="keys and recordings")
    add("--from", dest="recording", type=Path, metavar="RECORDING", help="judge it again, no robot")


def run(arguments: argparse.Namespace) -> int:
    """Bring it up, tell, write; 1 if something must be mended, or it was stopped.

    Raises:
        RobotFileError, RobotTextError, FollowerError, LinkKeyError, BusyError, RecordingError,
        IdentificationError, BringUpError: it can't be done; why.
    """
    path = robot_path(arguments.robot)
    robot_file = load_robot(path)
    text = path.read_bytes().decode("utf-8")
    out = _out(path, arguments.out)
    recording: Path | None = arguments.recording
    if recording is None:
        _refuse(robot_file, hung=arguments.hung)
        link = robot_file.link
        reached = robot_file.reached(arguments.host or link.host, arguments.port or link.port)
        recording, stopped = _recorded(reached, text, arguments)
        if stopped:
            print(f"Stopped: {stopped}\nThe robot was told zero thrust. recorded: {recording}")
            return 1
    recorded = DecodedRecording(read(recording, led=False))
    states = [item for item in recorded.items() if isinstance(item, RecordedState)]
    found = brought_up(robot_file.plant, states)
    print(report(robot_file.robot.name, found))
    if not found.against and robot_file.plant.suspension is None:
        print(UNKNOWN_ROPE)
        return 0
    if not found.is_sound:
        print("Nothing is written: mend what is said above, then bring it up again.")
        return 1
    text = written(text, found, recording.name)
    robot_of(tomllib.loads(text), str(out))  # nothing is written that can't be loaded
    with whole_new_file(out) as file:
        file.write(text.encode())
    print(f"written: {out}; before you fly it: lightleash robot check {out}")
    return int(bool(found.against))


def _out(path: Path, out: Path | None) -> Path:
    """Where the new file goes, never over an old one."""
    beside = Path() if is_shipped(path) else path.parent
    place = out or beside / f"{path.stem}-brought-up.toml"
    if place.suffix != ".toml" or place.exists():
        raise RobotTextError("--out", f"{place}: allowed: a new path ending in .toml")
    if not place.parent.is_dir():
        raise RobotTextError("--out", f"there is no folder {place.parent}")
    return place


def _refuse(robot_file: RobotFile, *, hung: bool) -> None:
    """What needs no robot to be refused.

    Raises:
        BringUpError: a robot that doesn't hang.
    """
    if robot_file.plant.suspension is None and not hung:
        raise BringUpError(
            f"{robot_file.robot.name} stands, by its file: pulses would tip it over. Allowed: hang"
            " it from a rope that gives by 20 cm and more, so that it turns freely, legs off the"
            " floor, and say --hung"
        )


def _recorded(robot_file: RobotFile, text: str, arguments: argparse.Namespace) -> tuple[Path, str]:
    """Bring a real robot up; its recording, and why it was stopped, or ""."""
    name = robot_file.robot.name
    stand = PulseProgramme(robot_file, 0.01 * arguments.percent)
    _confirm(robot_file, stand, arguments.confirm)
    with claimed_robot(arguments.state, name, "`lightleash robot bring-up`"):
        kind = link_kind(robot_file.link.kind)
        key = key_of(arguments.state, name, arguments.robot) if kind.keyed else new_key()
        epoch = next_epoch(epoch_file(arguments.state, name), clock.unix_ms())
        metadata = {DEVICE_KEY: "bring-up", ROBOT_KEY: text}
        folder = RecordingFolder(arguments.state / RECORDINGS)
        recorder = Recorder(folder, f"{name}-{clock.file_stamp()}", metadata)
        try:
            with (
                session.telling() as say,
                session.interruptible() as asked,
                session.punctual() as granted,
            ):
                if why := unfit(robot_file, granted, real=True):
                    raise BringUpError(why)
                with _linked(robot_file, key, epoch) as (follower, link):
                    wait = realtime.Schedule(PERIOD_S).wait
                    session.run(stand, follower, link, wait, recorder.status, asked, say, granted)
        finally:
            recorder.close()
    if recorder.error or recorder.lacks:
        raise BringUpError(f"{recorder.path}: {recorder.error or recorder.lacks}")
    return recorder.path, stand.stopped


def _confirm(robot_file: RobotFile, stand: PulseProgramme, given: str | None) -> None:
    """Somebody says that it hangs and that another one is at the stop.

    Raises:
        BringUpError: nobody does.
    """
    robot = robot_file.robot
    seconds = STILL_S + robot.A.shape[1] * (CHIRP_S + PAUSE_S)
    count, limits = robot.A.shape[1], (stand.level, robot.f_max)
    print(
        CHECKLIST.format(
            name=robot.name, count=count, level=limits[0], f_max=limits[1], seconds=seconds
        )
    )
    if given is None and sys.stdin.isatty():
        given = input(f"Type the robot's name, {robot.name}, to begin: ").strip()
    if given != robot.name:
        raise BringUpError(f"not confirmed: allowed: --confirm {robot.name}, or the name typed")


@contextmanager
def _linked(robot_file: RobotFile, key: bytes, epoch: int) -> Iterator[tuple[Follower, RobotLink]]:
    """The robot, by the link that flights have."""
    follower = connect(robot_file, key, epoch)
    try:
        silence = link_kind(robot_file.link.kind).silence
        yield follower, RobotLink(follower, 0, silence, robot_file.battery)
    finally:
        follower.close()


def report(name: str, found: BroughtUp) -> str:
    """What was found, for people."""
    lines = [f"{name}:", dashed(THRUSTERS, found.thrusters)]
    if found.identified is not None:
        told = [one for one in found.numbers if one.is_told and "thruster " not in one.key]
        turns = zip(found.mount_off.tolist(), found.mount_off_95.tolist(), strict=True)
        off = ", ".join(f"{degrees(one):.1f} ± {degrees(half):.1g}" for one, half in turns)
        lines += ["", table(COLUMNS, told), PER_MASS]
        lines += [f"motion sensors, beside the body's axes, about x, y, z: {off} degrees"]
        lines += [f"it {words}" for words in periods(found.numbers)]
        lines += [f"not told: {one.key}" for one in found.numbers if not one.is_told]
    lines += [f"!!  {words}" for words in found.against]
    return "\n".join(lines)


def written(text: str, found: BroughtUp, record: str) -> str:
    """The text of a robot file with what was found, each number with its interval and `record`.

    Raises:
        RobotTextError: it is written in a way in which that can't be said.
    """
    if found.sorting.swapped:
        said = f"robot bring-up: thrusters in the order in which {record} found them"
        text = with_thrusters_reordered(text, found.sorting.order, said)
    values, comments = file_numbers(found.known, found.numbers, "robot bring-up")
    comments = {key: f"{comment} (95 %), by {record}" for key, comment in comments.items()}
    text = with_numbers(text, values, comments)
    return with_intervals(text, file_intervals(found.numbers), f"robot bring-up, {record}")
