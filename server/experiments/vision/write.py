"""A film as files: what `lightleash locate` reads, and the truth beside it."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import yaml

from hardware.camera_file import direction_of
from hardware.sim.scenes.video import RenderedFrame, RenderedVideo
from pipeline.camera.lens import Camera
from pipeline.frames import Array, R_co, wxyz_from_R

IMU_HEADING = ("t_s", "gx", "gy", "gz", "ax", "ay", "az")
TIMES_HEADING = ("frame", "t_s")
TRUTH_HEADING = (
    *("frame", "t_s", "solvable", "visible"),
    *("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"),
)
ROBOT_NAME = "bench"


def write_film(film: RenderedVideo, folder: Path) -> None:
    """Frames as PNG, times.csv, imu.csv, body.csv, camera.yaml, robot.toml, truth.csv.

    Truth is the body in the OpenCV optical frame at the middle row, rotation as R_ob.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times: list[Sequence[object]] = []
    truth: list[Sequence[object]] = []
    phone: list[Sequence[object]] = []
    body: list[Sequence[object]] = []
    for k, shot in enumerate(film):
        name = f"{k:05}.png"
        cv2.imwrite(str(folder / name), shot.luma)
        times.append((name, _number(shot.t)))
        truth.append((name, *_truth(shot)))
        phone += [_reading(s.t, s.omega_m_cf_in_c, s.a_m_cf_in_c) for s in shot.phone]
        body += [_reading(s.t, s.omega_m_bf_in_b, s.a_m_bf_in_b) for s in shot.body]
    _table(folder / "times.csv", TIMES_HEADING, times)
    _table(folder / "truth.csv", TRUTH_HEADING, truth)
    _table(folder / "imu.csv", IMU_HEADING, phone)
    _table(folder / "body.csv", IMU_HEADING, body)
    (folder / "camera.yaml").write_text(camera_text(film.camera, f"bench-{film.scene.name}"))
    (folder / "robot.toml").write_text(robot_text(film.leds_in_b))


def camera_text(camera: Camera, name: str) -> str:
    """ROS camera_info with the readout time."""
    table = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": camera.K.ravel().tolist()},
        "distortion_model": camera.model,
        "distortion_coefficients": {
            "rows": 1,
            "cols": len(camera.distortion),
            "data": camera.distortion.tolist(),
        },
        "rolling_shutter_readout_s": abs(float(camera.readout_s)),
        "rolling_shutter_direction": direction_of(camera.readout_axis, camera.readout_s),
    }
    return str(yaml.safe_dump(table, sort_keys=False))


def robot_text(leds_in_b: Array) -> str:
    """A robot file of LEDs alone."""
    rows = [f"[[leds]]\nposition_in_body_m = {led.tolist()}\n" for led in leds_in_b]
    return f'name = "{ROBOT_NAME}"\n\n' + "\n".join(rows)


def _truth(shot: RenderedFrame) -> tuple[object, ...]:
    p_bo_in_o, R_ob = R_co.T @ shot.p_bc_in_c, R_co.T @ shot.R_cb
    flags = (int(shot.solvable), "".join(str(int(x)) for x in shot.visible))
    return (_number(shot.t), *flags, *map(_number, (*p_bo_in_o, *wxyz_from_R(R_ob))))


def _reading(t: float, rate: Array, force: Array) -> tuple[str, ...]:
    return tuple(map(_number, (t, *rate, *force)))


def _number(x: float) -> str:
    return f"{float(x):.9g}"


def _table(path: Path, heading: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heading)
        writer.writerows(rows)
