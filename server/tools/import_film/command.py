"""`lightleash import`, from its words to the recording."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import av
import av.error
import numpy as np

from hardware.camera_file import CameraFileError, load_camera
from hardware.robot_file import COMMANDS, RobotFileError, load_robot, robot_path
from pipeline.frames import Array
from server.common.errors import InputError
from server.common.options import Parser
from server.common.ranges import number
from server.media.frame_source import RATES_HZ
from server.media.tables import IMU_HEADER, load_imu
from server.recording.writer import (
    CAMERA_KEY,
    DEVICE_KEY,
    ROBOT_KEY,
    SETTINGS_KEY,
    UNIX_ZERO_KEY,
    write_whole,
)
from server.tools.import_film.entries import LEAD_S, entries
from server.tools.import_film.pictures import Taken, pictures_of

ABOUT = f"""Make a recording of a film that any phone or camera took, and of its motion samples:
`lightleash locate`, `calibrate`, `replay` and `export` take it.

--imu: CSV with the columns {",".join(IMU_HEADER)} [s, rad/s, m/s², gravity included], axes x
along the view, y left, z up of the picture as the film holds it. Its clock becomes the recording's;
--offset says by how much the film's own times must be raised to be on it."""
MARGIN_S = 5.0
"""Motion samples of so long before and after the film are kept."""
CALENDAR_S = 1e9
"""Later times are seconds since 1970: 2001 was."""
MOST_OFFSET_S = 1e10
"""Far beyond any calendar's; a recording counts nanoseconds to 1.8e10 s."""


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="lightleash import",
        description=ABOUT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("film", type=Path, metavar="FILM_OR_FOLDER")
    parser.add_argument("--imu", type=Path, metavar="CSV")
    parser.add_argument("--out", type=Path, required=True, metavar="RECORDING.mcap")
    moved = number(-MOST_OFFSET_S, MOST_OFFSET_S)
    parser.add_argument("--offset", type=moved, default=0.0, metavar="S", help="default 0")
    rate = number(*RATES_HZ)
    parser.add_argument("--fps", type=rate, help="in place of the film's own times")
    parser.add_argument("--camera", type=Path, metavar="YAML", help="its camera file, if known")
    parser.add_argument("--device", help="its name; default: as the camera file says")
    parser.add_argument("--robot", default="ames", help="whose LEDs it films; default ames")
    parser.add_argument(
        "--screen-angle", type=int, choices=(0, 90, 180, 270), default=0, metavar="DEG"
    )
    return parser


def main(argv: Sequence[str]) -> int:
    """Entry of `lightleash import`: 0 done, 2 wrong arguments or files."""
    given = _parser().parse_args(list(argv))
    try:
        print(_run(given))
    except (InputError, CameraFileError, RobotFileError, OSError) as error:
        print(f"lightleash import: {error}", file=sys.stderr)
        return 2
    return 0


def _run(given: argparse.Namespace) -> str:
    """Write the recording; gives a line about it."""
    metadata = _metadata(given)
    imu = load_imu(given.imu) if given.imu is not None else np.zeros((0, 7))
    pictures, how = pictures_of(given.film, given.fps, given.screen_angle)
    pictures = [(t + given.offset, picture) for t, picture in pictures]
    imu = _during(pictures, imu, given.imu)
    begin = min([pictures[0][0], *imu[:1, 0].tolist()])
    shift = max(0.0, 2.0 * LEAD_S - begin)  # neither clock knows a time before 0
    zero_ns = _unix_zero_ns(given.film, begin, pictures[0][0])
    if zero_ns is not None:
        metadata[UNIX_ZERO_KEY] = str(zero_ns - round(1e9 * shift))
    pictures = [(t + shift, picture) for t, picture in pictures]
    imu = imu + shift * np.eye(7)[0]
    write_whole(given.out, metadata, entries(pictures, imu, metadata[DEVICE_KEY]))
    span = pictures[-1][0] - pictures[0][0]
    return (
        f"{given.out}: {len(pictures)} pictures of {span:.1f} s ({how}), {len(imu)} motion samples"
    )


def _metadata(given: argparse.Namespace) -> dict[str, str]:
    load_robot(given.robot, takes=COMMANDS)  # refused here, not by who reads the recording
    device, camera = given.device or given.film.stem, ""
    if given.camera is not None:
        name, _ = load_camera(given.camera)
        device, camera = given.device or name, given.camera.read_text(encoding="utf-8")
    return {
        DEVICE_KEY: device,
        ROBOT_KEY: robot_path(given.robot).read_text(encoding="utf-8"),
        CAMERA_KEY: camera,
        SETTINGS_KEY: f"imported from {given.film.name}",
    }


def _during(pictures: Sequence[Taken], imu: Array, file: Path | None) -> Array:
    """Motion samples about the time of the film.

    Raises:
        InputError: there is none.
    """
    first, last = pictures[0][0], pictures[-1][0]
    near = imu[(imu[:, 0] > first - MARGIN_S) & (imu[:, 0] < last + MARGIN_S)]
    if file is not None and not np.any((near[:, 0] >= first) & (near[:, 0] <= last)):
        raise InputError(
            file,
            "t_s",
            f"{imu[0, 0]:.3f} to {imu[-1, 0]:.3f} s, but the film is from {first:.3f} to"
            f" {last:.3f} s: say with --offset how far its clock is off",
        )
    return near


def _unix_zero_ns(film: Path, begin: float, first: float) -> int | None:
    """Calendar's time at 0 of the recording's clock: by the clock itself, or as the film says."""
    if begin > CALENDAR_S:
        return 0
    with suppress(av.error.FFmpegError, OSError, ValueError), av.open(str(film)) as container:
        created = container.metadata.get("creation_time")
        if created is not None:
            began = datetime.fromisoformat(created)
            return round(1e9 * (began.timestamp() - first))
    return None
