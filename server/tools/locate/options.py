"""What may be asked of `lightleash locate`, and how its files look."""

from __future__ import annotations

import argparse
from pathlib import Path

from server.common.options import Parser
from server.common.ranges import number
from server.media.frame_source import RATES_HZ
from server.media.plots import picture_file

PURPOSE = (
    "Where was the robot in each frame, and how sure is that? Runs the live pipeline on files."
)
FORMATS = """\
files:
  FRAMES         a folder of .png and .jpg, taken in the order of their names, all of one size;
                 times.csv in it (header frame,t_s) dates them; or a film, dated by itself; or a
                 recording (.mcap), which brings its motion samples too
  camera.yaml    ROS camera_info (plumb_bob, rational_polynomial, equidistant) or a Kalibr
                 camchain; rolling_shutter_readout_s: a row's time is the frame's time
                 + (row/height - 1/2) x readout; rolling_shutter_direction: top_to_bottom (if
                 missing), bottom_to_top, left_to_right or right_to_left
  robot.toml     [[leds]] with position_in_body_m = [x, y, z], 3 to 32 of them
  imu.csv        t_s,gx,gy,gz,ax,ay,az in rad/s and m/s^2 (specific force: +9.8 up at rest) on the
                 frames' clock, in camera axes: x forward (optical axis), y left, z up
  body.csv       the same in body axes, those of robot.toml
  poses.csv      one row a frame: position and rotation (R_ob as qw..qz) of the body in OpenCV's
                 optical frame (z forward, x right, y down) at the frame's time, standard deviations
                 (rotation: about the optical axes), LEDs, RMS reprojection, CPU time by stage;
                 found = 0 and empty cells where the frame gives no believable pose
  FILE.npz       frame, t_s, found, covariance (n, 6, 6; NaN: not found) of position [m] and
                 rotation [rad] in optical axes, R_ob = Exp(rotation error) R_ob_estimated
"""


def parser() -> argparse.ArgumentParser:
    """Parser of the words behind `lightleash locate`."""
    words = Parser(
        prog="lightleash locate",
        description=PURPOSE,
        epilog=FORMATS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    words.add_argument(
        "frames", type=Path, metavar="FRAMES", help="folder of frames, film or recording"
    )
    words.add_argument("--camera", type=Path, required=True, metavar="camera.yaml")
    words.add_argument("--robot", required=True, metavar="robot.toml", help="or a name: ames, ...")
    words.add_argument("--imu", type=Path, metavar="imu.csv", help="the camera's motion sensors")
    words.add_argument("--body-imu", type=Path, metavar="body.csv", help="the robot's")
    words.add_argument(
        "--fps",
        type=number(*RATES_HZ),
        help="frames a second: without times.csv (default: 30), or of a film in place of its times",
    )
    words.add_argument("--out", type=Path, required=True, metavar="poses.csv")
    words.add_argument("--covariance", type=Path, metavar="FILE.npz", help="full 6x6, for numpy")
    words.add_argument("--overlay", type=Path, metavar="DIR", help="frames with what was seen")
    words.add_argument(
        "--plot", type=picture_file, metavar="FILE", help="default: beside poses.csv, as .png"
    )
    words.add_argument("--no-plot", action="store_true")
    return words


def outputs_of(given: argparse.Namespace) -> dict[str, Path]:
    """Path by option of all that is written."""
    plot_file = given.plot or given.out.with_suffix(".png")
    places = {
        "--out": given.out,
        "--covariance": given.covariance,
        "--plot": None if given.no_plot else plot_file,
        "--overlay": given.overlay,
    }
    return {option: path for option, path in places.items() if path is not None}
