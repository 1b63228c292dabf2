"""`lightleash locate` on films that are drawn, and its tables beside the truth."""

import csv

import numpy as np

from hardware.sim.scenes.scene import SCENES, VGA
from hardware.sim.scenes.video import RenderedVideo
from pipeline.frames import R_from_wxyz, log
from server.cli import main
from server.experiments.vision.write import write_film

FRAMES, SEED = 24, 7


def write_scene(name, folder):
    """Frames, motion samples, camera and robot file, truth."""
    write_film(RenderedVideo(SCENES[name], seed=SEED, size=VGA, frames=FRAMES), folder)
    return folder


def run(folder, out, *more, camera=None, robot=None, frames=None, imu=True):
    words = ["locate", str(frames or folder), "--camera", str(camera or folder / "camera.yaml")]
    words += ["--robot", str(robot or folder / "robot.toml"), "--out", str(out)]
    if imu:
        words += ["--imu", str(folder / "imu.csv"), "--body-imu", str(folder / "body.csv")]
    return main([*words, *map(str, more)])


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def number(row, *names):
    return np.array([float(row[name]) for name in names])


def error(row, true):
    """(δp, θ) in o with truth = estimate + δp, Exp(θ) estimate."""
    place, q = ("x_m", "y_m", "z_m"), ("qw", "qx", "qy", "qz")
    turn = R_from_wxyz(number(true, *q)) @ R_from_wxyz(number(row, *q)).T
    return np.concatenate((number(true, *place) - number(row, *place), log(turn)))


def errors(out, folder):
    rows, truth = table(out), table(folder / "truth.csv")
    assert [row["frame"] for row in rows] == [row["frame"] for row in truth]
    return np.array([error(*pair) for pair in zip(rows, truth, strict=True) if pair[0]["x_m"]])


def copied(folder, to, *names):
    to.mkdir()
    for name in names or [file.name for file in folder.iterdir()]:
        (to / name).write_bytes((folder / name).read_bytes())
    return to
