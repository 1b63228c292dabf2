"""Where are this robot's LEDs? From a film of it at rest, walked about with the phone."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hardware.camera_file import CameraFileError, load_camera
from hardware.led_file import load_leds, on_a_line
from hardware.robot_file import RobotFileError
from pipeline.camera.lens import Camera
from pipeline.frames import Array
from server.common.errors import InputError
from server.common.options import Parser
from server.media.plots import drawn
from server.media.tables import load_imu
from server.tools.survey import options
from server.tools.survey.picture import draw
from server.tools.survey.reconstruction.bundle import DistanceConstraint
from server.tools.survey.reconstruction.datum import fitted, levelled, matched
from server.tools.survey.reconstruction.detections import FrameSpots
from server.tools.survey.reconstruction.errors import SurveyError
from server.tools.survey.reconstruction.gyro import GyroAttitude
from server.tools.survey.reconstruction.structure import COUNTS, Structure, measured, shape
from server.tools.survey.report import Survey, figures, lines, toml
from server.tools.survey.video import picture, read, times

HOW = """\
Film the robot at rest, dark, all LEDs lit, exposure short, zoom and stabilisation off: 10 to 20
seconds, slowly, 30 degrees to each side of it and up and down. Measure one distance between two
LEDs. LEDs are numbered from left to right in the first frame that shows all (see survey.png),
or as in --design. Exit code: 0 good or usable, 1 bad, 2 no answer.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash survey`."""
    arguments = _parser().parse_args(argv)
    try:
        return _run(arguments)
    except (SurveyError, InputError, CameraFileError, RobotFileError) as error:
        print(f"lightleash survey: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="lightleash survey",
        description="Where the LEDs are, from a film of the robot at rest.",
        epilog=HOW,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("film", type=Path, metavar="FRAMES_OR_VIDEO", help="as for lightleash locate")
    add("--camera", type=Path, required=True, metavar="YAML", help="the calibrated camera")
    add("--leds", type=int, required=True, metavar="N", help="how many, 4 to 8")
    add(
        "--distance",
        type=options.distance,
        action="append",
        required=True,
        metavar="A,B=M",
        help="LEDs A and B are M metres apart; may be given several times",
    )
    add("--distance-sigma-mm", type=float, default=0.5, metavar="MM", help="default 0.5")
    add("--imu", type=Path, metavar="CSV", help="the phone's, in camera axes, as for locate")
    add("--fps", type=float, help="of frames without times")
    add("--every", type=int, default=1, metavar="N", help="take every N-th frame")
    place = parser.add_mutually_exclusive_group()
    place.add_argument("--design", metavar="ROBOT", help="axes and numbers of its [[leds]]")
    place.add_argument(
        "--known",
        type=options.known,
        action="append",
        metavar="A=x,y,z",
        help="LED A is there in the body [m]: at least three times",
    )
    add("--out", type=Path, required=True, metavar="TOML", help="[[leds]]; .json, .png beside it")
    add("--json", action="store_true", help="print figures as JSON in place of the report")
    return parser


def _run(arguments: argparse.Namespace) -> int:
    _check(arguments)
    _, camera = load_camera(arguments.camera)
    design = None if arguments.design is None else load_leds(arguments.design)[1]
    film = read(arguments.film, camera, arguments.fps, arguments.every)
    gyro = None
    if arguments.imu is not None:
        gyro = GyroAttitude(load_imu(arguments.imu), times(film))
    survey = _surveyed(arguments, camera, film, design, gyro)
    print(json.dumps(figures(survey), indent=1) if arguments.json else "\n".join(lines(survey)))
    _write(arguments, camera, film, survey)
    return 1 if survey.grade == "bad" else 0


def _check(arguments: argparse.Namespace) -> None:
    low, high = COUNTS
    if not low <= arguments.leds <= high:
        raise SurveyError(f"--leds: from {low} to {high}, not {arguments.leds}")
    said = [led for tape in arguments.distance for led in (tape.a, tape.b)]
    said += [known.led for known in arguments.known or ()]
    if max(said) >= arguments.leds:
        raise SurveyError(
            f"LED {max(said) + 1} of --distance or --known: there are {arguments.leds}"
        )
    if not 0.01 <= arguments.distance_sigma_mm <= 50.0:
        raise SurveyError("--distance-sigma-mm: from 0.01 to 50")
    if arguments.every < 1 or (arguments.fps is not None and not 0.01 <= arguments.fps <= 1e4):
        raise SurveyError("--every: from 1; --fps: from 0.01 to 10000")
    if arguments.known and len({known.led for known in arguments.known}) < 3:
        raise SurveyError("--known: at least three different LEDs")
    if arguments.known and on_a_line(np.array([known.place for known in arguments.known])):
        raise SurveyError("--known: not all on one line: a turn about it would be open")
    if arguments.out.suffix != ".toml" or arguments.out.is_dir():
        raise SurveyError(f"--out: a file ending in .toml, not {arguments.out}")
    if not arguments.out.parent.is_dir():
        raise SurveyError(f"--out: there is no folder {arguments.out.parent}")


def _surveyed(
    arguments: argparse.Namespace,
    camera: Camera,
    film: list[FrameSpots],
    design: Array | None,
    gyro: GyroAttitude | None,
) -> Survey:
    found = shape(camera, film, arguments.leds, gyro)
    order = range(arguments.leds) if design is None else matched(found.scene.points, design)
    sigma = 1e-3 * arguments.distance_sigma_mm
    tapes = tuple(
        DistanceConstraint(tape.a, tape.b, tape.metres, sigma) for tape in arguments.distance
    )
    structure = measured(camera, film, found, order, tapes, gyro)
    body = _in_body(structure, design, arguments.known, gyro)
    turn = np.kron(np.eye(arguments.leds), body.R)
    scene = structure.scene
    return Survey(
        leds_in_b=body.leds_in_b,
        covariance=turn @ structure.covariance @ turn.T,
        scene=replace(
            scene,
            points=body.leds_in_b,
            R=scene.R @ body.R.T,
            p=scene.p - scene.R @ body.R.T @ body.t,
        ),
        structure=structure,
        axes=body.words,
        design=design,
        tapes=tapes,
        frames=len(film),
        named=len(found.names),
        spread_rad=found.spread_rad,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """LEDs in b, and how the survey's frame s came there: R X + t."""

    leds_in_b: Array
    R: Array
    t: Array
    words: str


def _in_body(
    structure: Structure,
    design: Array | None,
    known: Sequence[options.KnownLed] | None,
    gyro: GyroAttitude | None,
) -> _Body:
    points = structure.scene.points
    if design is not None:
        leds, R, t, _ = fitted(points, design)
        return _Body(leds, R, t, "the design's, fitted to all its LEDs")
    if known:
        some = [one.led for one in known]
        places = np.array([one.place for one in known])
        near, R, t, _ = fitted(points[some], places)
        off = 1e3 * float(np.linalg.norm(near - places, axis=1).max())
        return _Body(points @ R.T + t, R, t, f"fitted to the LEDs known, within {off:.2f} mm")
    first = structure.frames[0]
    in_o = points @ structure.scene.R[0].T
    up = None if gyro is None else gyro.up_in_c(first)
    leds = levelled(in_o, up)
    _, R, t, _ = fitted(points, leds)
    level = "levelled by gravity" if gyro is not None else "as it was held"
    words = f"of the camera in frame {first + 1}, {level} (x ahead, y left, z up); origin: the mean"
    return _Body(leds, R, t, words)


def _write(
    arguments: argparse.Namespace, camera: Camera, film: Sequence[FrameSpots], survey: Survey
) -> None:
    out: Path = arguments.out
    luma = picture(arguments.film, arguments.fps, film[survey.structure.frames[0]].name)
    text = json.dumps(figures(survey), indent=1) + "\n"
    try:
        out.write_text("\n".join(toml(survey)) + "\n", encoding="utf-8")
        out.with_suffix(".json").write_text(text, encoding="utf-8")
        pictures = drawn(lambda: [draw(survey, camera, luma, out.with_suffix(".png"))])
    except OSError as error:
        raise SurveyError(f"--out: {error.filename}: {error.strerror}") from error
    files = [out, out.with_suffix(".json"), *pictures]
    print(f"wrote {', '.join(map(str, files))}", file=sys.stderr)
