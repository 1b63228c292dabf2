"""`lightleash locate`, from its words to its files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from csv import DictWriter
from pathlib import Path
from threading import Timer

import cv2

from hardware.camera_file import CameraFileError, load_camera
from hardware.led_file import load_leds
from hardware.robot_file import RobotFileError
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from pipeline.vision.visual_front_end import warm_up
from server.common.errors import InputError
from server.common.progress import progress_bar
from server.export.recorded_film import imu_samples, open_film
from server.media.frame_source import Frames
from server.media.plots import no_plots
from server.media.tables import load_imu
from server.tools.locate import overlay, plot
from server.tools.locate.history import History
from server.tools.locate.optical import COLUMNS, row
from server.tools.locate.options import outputs_of, parser
from server.tools.locate.outputs import check_places, whole_file, whole_folder
from server.tools.locate.summary import camera_lines, summary
from server.tools.locate.work import ImuRecordings, Located, Locator

COMPILING_S = 4.0
"""What is compiled already is loaded in less."""
FEW = 4
"""So many LEDs must be seen for a pose from nothing."""


def _run(given: argparse.Namespace) -> None:
    outputs = outputs_of(given)
    if "--plot" in outputs and (why := no_plots()):
        _print_notes([why])
        del outputs["--plot"]
    inputs = [path for path in (given.camera, given.imu, given.body_imu) if path is not None]
    inputs += [path for path in (Path(given.robot), given.frames) if path.is_file()]
    check_places(list(outputs.items()), inputs, given.frames)
    _, camera = load_camera(given.camera)
    _, leds_in_b = load_leds(given.robot)
    files = (given.imu, given.body_imu)
    motion = ImuRecordings(
        *(
            load_imu(file) if file is not None else recorded
            for file, recorded in zip(files, imu_samples(given.frames), strict=True)
        )
    )
    frames = open_film(given.frames, given.fps)
    for file, table in zip(files, (motion.camera, motion.body), strict=True):
        _check_clock(file, table, frames)
    printed = len(frames.notes)
    _print_notes([*frames.notes, *_missing(motion, leds_in_b)])
    _warm_up()
    locator = Locator(camera, leds_in_b, motion)
    history = _work(locator, leds_in_b, frames, outputs)
    print(summary(history))
    for line in camera_lines(camera, locator.front_end):
        print(line)
    print(f"\nwritten: {', '.join(str(path) for path in outputs.values())}")
    _print_notes([*frames.notes[printed:], *_doubts(history, files)])


def _warm_up() -> None:
    """Who waits for a compiler is told so."""
    words = ["compiling the pipeline; that happens once and takes about a minute"]
    timer = Timer(COMPILING_S, _print_notes, (words,))
    timer.start()
    try:
        warm_up()
    finally:
        timer.cancel()


def _work(locator: Locator, leds_in_b: Array, frames: Frames, outputs: dict[str, Path]) -> History:
    """Look at all frames; what is written appears when all is done."""
    history = History()
    with ExitStack() as stack:
        parts = {
            option: stack.enter_context(
                whole_folder(path) if option == "--overlay" else whole_file(path)
            )
            for option, path in outputs.items()
        }
        file = stack.enter_context(parts["--out"].open("w", encoding="utf-8", newline=""))
        writer = DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        bar = stack.enter_context(progress_bar(frames.count, "frames"))
        found = 0
        for located in locator.locate(frames):
            writer.writerow(_row(located))
            history.add(located)
            if "--overlay" in parts:
                _paint(located, locator.camera, leds_in_b, parts["--overlay"])
            found += located.pose is not None
            bar.set_postfix_str(f"found {100.0 * found / len(history):.1f} %", refresh=False)
            bar.update()
        if "--covariance" in parts:
            history.save_covariances(parts["--covariance"])
        if "--plot" in parts:
            plot.draw(
                history, parts["--plot"], f"{outputs['--out'].stem}: body in the optical frame"
            )
    return history


def _row(located: Located) -> dict[str, str]:
    shot, detection = located.shot, located.detection
    took = detection.took_s if detection is not None else {}
    return row(shot.name, shot.t, located.pose, located.leds, took)


def _paint(located: Located, camera: Camera, leds_in_b: Array, folder: Path) -> None:
    luma = located.shot.luma
    if luma is not None:
        picture = overlay.draw(luma, located, camera, leds_in_b)
        _, data = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, 90))
        (folder / f"{Path(located.shot.name).stem}.jpg").write_bytes(data.tobytes())


def _check_clock(file: Path | None, table: Array | None, frames: Frames) -> None:
    """Motion samples must be of the frames' time."""
    if file is None or table is None or frames.span is None:
        return
    (first, last), (begin, end) = frames.span, (float(table[0, 0]), float(table[-1, 0]))
    if end < first or begin > last:
        raise InputError(
            file,
            "t_s",
            f"{begin:.3f} to {end:.3f} s, but the frames are from {first:.3f} to {last:.3f} s:"
            " both must be on one clock",
        )


def _missing(motion: ImuRecordings, leds_in_b: Array) -> list[str]:
    """What would help, and isn't there."""
    missing: list[str] = []
    if motion.camera is None and motion.body is None:
        missing.append("no motion samples (--imu, --body-imu): found by the lights alone")
    elif motion.camera is None:
        missing.append("no --imu: the camera's turning and its vertical are not known")
    elif motion.body is None:
        missing.append("no --body-imu: the robot's vertical is not known, so gravity is no help")
    if len(leds_in_b) < FEW:
        missing.append(f"{len(leds_in_b)} LEDs: without a pose to start from {FEW} must be seen")
    return missing


def _doubts(history: History, files: Sequence[Path | None]) -> list[str]:
    """What may be wrong with the motion samples."""
    pairs = zip(files, history.without_motion, strict=True)
    gaps = [
        f"{file} says nothing about {count} of {len(history)} frames"
        for file, count in pairs
        if file is not None and count
    ]
    return [*gaps, *history.gravity.words(*(str(file) for file in files))]


def _print_notes(notes: Sequence[str]) -> None:
    for note in notes:
        print(f"note: {note}", file=sys.stderr)


def main(argv: Sequence[str]) -> int:
    """Entry of `lightleash locate`."""
    given = parser().parse_args(list(argv))
    cv2.setNumThreads(1)  # so that the CPU time of this thread is that of all the work
    try:
        _run(given)
    except (InputError, CameraFileError, RobotFileError) as error:
        print(f"lightleash locate: {error}", file=sys.stderr)
        return 2
    return 0
