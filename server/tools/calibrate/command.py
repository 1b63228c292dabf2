"""`lightleash calibrate`: a film of a ChArUco board becomes a camera file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hardware.camera_file import CameraFileError, direction_of
from pipeline.frames import Array
from server.calibration.board import DICTIONARIES, Board, BoardError, parse
from server.calibration.camera_imu import ImuError, gyro_of
from server.calibration.camera_yaml import PROFILES, profile_path, store, yaml_of
from server.calibration.lens import COEFFICIENTS
from server.calibration.solve import CalibrationSolution, solve
from server.calibration.verdict import Verdict, judge, judge_views
from server.common.clock import today
from server.common.errors import InputError
from server.common.options import Parser
from server.common.ranges import number
from server.common.settings import state_directory
from server.export.recorded_film import imu_samples
from server.media.frame_source import RATES_HZ
from server.media.plots import drawn, picture_file
from server.media.tables import IMU_HEADER, load_imu
from server.tools.calibrate.draw_board import write_board
from server.tools.calibrate.report import draw
from server.tools.calibrate.video import BoardVideo, FilmError, watch

BAR = 30  # letters wide

ABOUT = f"""Calibrate a camera with a film of a ChArUco board.

Print a board (--write-board board.pdf), glue it to something flat, or show /board of a running
server, or board.svg, on any flat monitor. Film it for half a minute as the phone's page will film
the robot: the same lens, picture size and orientation, no zoom, no stabilisation. Near and far,
tilted by 30 to 45° to all sides, into every corner of the picture, gently turning to and fro: the
readout time shows in motion only. A folder needs times.csv (frame,t_s) or --fps for that; a
recording (.mcap) brings its times and its motion samples.

--imu: motion samples in CSV, columns {",".join(IMU_HEADER)} [s, rad/s, m/s²],
axes x along the view, y left, z up: adds how the sensors sit at the camera and how far their
clock is off."""


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="lightleash calibrate",
        description=ABOUT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("film", nargs="?", type=Path, metavar="FRAMES_OR_VIDEO")
    parser.add_argument("--fps", type=number(*RATES_HZ), help="of a folder without times.csv")
    parser.add_argument("--imu", type=Path, metavar="CSV")
    board = parser.add_argument_group("board")
    board.add_argument("--board", default="9x6", metavar="CxR", help="squares; default 9x6")
    board.add_argument("--square-mm", type=float, default=25.0, help="default 25; any unit will do")
    board.add_argument("--marker-mm", type=float, help="default: 3/4 of the square")
    board.add_argument("--dictionary", choices=DICTIONARIES, default=next(iter(DICTIONARIES)))
    board.add_argument("--legacy", action="store_true", help="drawn by OpenCV before 4.6")
    board.add_argument(
        "--write-board", "--board-svg", type=Path, metavar="FILE", help=".svg, .pdf or .png"
    )
    parser.add_argument("--model", choices=COEFFICIENTS, default="plumb_bob")
    parser.add_argument("--name", help="of device and lens, as the supervisor's page shows it")
    parser.add_argument("--screen-angle", type=int, choices=(0, 90, 180, 270), metavar="DEG")
    parser.add_argument("--out", type=Path, metavar="YAML", help="the camera file")
    parser.add_argument(
        "--store", action="store_true", help="keep it where `lightleash serve` looks; needs --name"
    )
    parser.add_argument(
        "--report", type=picture_file, metavar="PNG", help="a picture of what was found"
    )
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash calibrate`: 0 calibrated, 1 refused, 2 wrong arguments or files."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    try:
        board = parse(
            arguments.board,
            arguments.square_mm,
            arguments.marker_mm,
            arguments.dictionary,
            arguments.legacy,
        )
        if arguments.write_board is not None:
            write_board(board, arguments.write_board)
            print(f"{arguments.write_board}: a board of {arguments.board} squares")
        if arguments.film is None:
            if arguments.write_board is None:
                parser.error("wants FRAMES_OR_VIDEO or --write-board")
            return 0
        if arguments.store and not arguments.name:
            parser.error("--store needs --name")
        return _calibrate(arguments, board)
    except (BoardError, CameraFileError, FilmError, ImuError, InputError, OSError) as error:
        print(f"lightleash calibrate: {error}", file=sys.stderr)
        return 2


def _calibrate(arguments: argparse.Namespace, board: Board) -> int:
    imu = load_imu(arguments.imu) if arguments.imu is not None else imu_samples(arguments.film)[0]
    gyro = gyro_of(imu) if imu is not None else None
    filmed = watch(arguments.film, arguments.fps, board, _bar())
    verdict = judge_views(filmed.views, filmed.pictures, board, filmed.size)
    found = None
    if verdict is None:
        found = solve(filmed.views, board, filmed.size, arguments.model, gyro, filmed.timed)
    if found is None or verdict is not None:
        return _refuse(verdict or Verdict("refused", ["Too few views."]))
    verdict = judge(found)
    print("\n".join(table(found, filmed)))
    name = arguments.name or "camera"
    if arguments.report is not None:
        for path in drawn(lambda: [draw(found, verdict, name, arguments.report)]):
            print(f"picture: {path}")
    if verdict.level == "refused":
        return _refuse(verdict)
    _print_verdict(verdict)
    text = yaml_of(found, verdict, name, arguments.screen_angle, today())
    for path in _places(arguments, found.size):
        store(path, text)
        print(f"camera file: {path}")
    return 0


def _places(arguments: argparse.Namespace, size: tuple[int, int]) -> list[Path]:
    places = [arguments.out] if arguments.out is not None else []
    if arguments.store:
        folder = state_directory() / PROFILES
        places.append(profile_path(folder, arguments.name, size, arguments.screen_angle))
    return places


def _refuse(verdict: Verdict) -> int:
    _print_verdict(verdict)
    return 1


def _print_verdict(verdict: Verdict) -> None:
    print(f"\nVerdict: {verdict.level}.")
    for reason in verdict.reasons:
        print(f"  - {reason}")
    if verdict.advice:
        print("To do better:")
    for advice in verdict.advice:
        print(f"  - {advice}")


def table(found: CalibrationSolution, filmed: BoardVideo) -> list[str]:
    """The calibration as lines of text."""
    value, sigma = found.shared, found.sigma
    rows = [
        ("pictures with the board", f"{len(filmed.views)} of {filmed.pictures}"),
        ("views used, kept out", f"{len(found.choice.fit)}, {len(found.choice.held_out)}"),
        ("reprojection, kept out [px]", f"{found.held_out_px:.3f} (fitted {found.fitted_px:.3f})"),
        ("focal length fx, fy [px]", _pair(value[:2], sigma[:2], 2)),
        ("principal point [px]", _pair(value[2:4], sigma[2:4], 2)),
        (f"distortion ({found.model})", ", ".join(f"{x:.4f}" for x in value[4:-1])),
        ("  its σ", ", ".join(f"{x:.4f}" for x in sigma[4:-1])),
    ]
    if found.readout_known:
        direction = direction_of(found.readout_axis, value[-1]).replace("_", " ")
        words = f"{1e3 * abs(value[-1]):.2f} ± {1e3 * sigma[-1]:.2f}, {direction}"
        rows.append(("readout [ms]", words))
    if found.imu is not None:
        angles = np.rad2deg(found.imu.sigma[:3]).max()
        offset, offset_sigma = 1e3 * found.imu.time_offset_s, 1e3 * found.imu.sigma[3]
        rows.append(("sensors' time offset [ms]", f"{offset:.2f} ± {offset_sigma:.2f}"))
        rows.append(("sensors' rotation σ [°]", f"{angles:.2f}"))
    return [f"{name:<30}{text}" for name, text in rows]


def _pair(values: Array, sigma: Array, digits: int) -> str:
    pairs = zip(values, sigma, strict=True)
    return ", ".join(f"{value:.{digits}f} ± {one:.{digits}f}" for value, one in pairs)


def _bar() -> Callable[[int, int | None], object]:
    """A progress bar, where somebody watches."""
    if not sys.stderr.isatty():
        return lambda *_: None

    def show(done: int, count: int | None) -> None:
        total = count or done + 1
        share = min((done + 1) / max(total, 1), 1.0)
        full = round(BAR * share)
        end = "\n" if done + 1 >= total else ""
        bar = "█" * full + "·" * (BAR - full)
        print(f"\r  looking for the board {bar} {done + 1}/{total}", end=end, file=sys.stderr)

    return show
