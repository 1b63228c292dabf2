"""`lightleash calibrate`, from pictures to a camera file."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from hardware.camera_file import load_camera
from server.tools.calibrate.command import main
from tests.server.calibration.filming import Motion, Phone, Studio, scaled

BOARD = ["--square-mm", "30"]


def write_film(folder, phone, motion, count, fps=30.0):
    studio, rng = Studio(phone), np.random.default_rng(0)
    lines = ["frame,t_s"]
    for k in range(count):
        cv2.imwrite(str(folder / f"{k:04d}.png"), studio.picture(motion, 1.0 + k / fps, rng=rng))
        lines.append(f"{k:04d}.png,{1.0 + k / fps:.6f}")
    (folder / "times.csv").write_text("\n".join(lines) + "\n")


@pytest.mark.slow
def test_a_folder_of_pictures_becomes_a_camera_file(tmp_path, capsys):
    phone = scaled(Phone(), 640)
    write_film(tmp_path, phone, Motion(seed=1, tremor=0.0), 75, fps=15.0)
    out, report = tmp_path / "camera.yaml", tmp_path / "report.png"
    words = [str(tmp_path), *BOARD, "--name", "lab phone", "--out", str(out)]
    assert main([*words, "--report", str(report)]) == 0
    name, camera = load_camera(out)
    assert name == "lab phone"
    assert camera.K[0, 0] == pytest.approx(phone.lens[0], rel=0.003)
    assert camera.readout_s == pytest.approx(phone.readout_s, rel=0.15)
    assert report.read_bytes()[:4] == b"\x89PNG"
    assert "Verdict:" in capsys.readouterr().out


def test_too_few_pictures_are_refused_and_nothing_is_written(tmp_path, capsys):
    write_film(tmp_path, scaled(Phone(), 320), Motion(), 3)
    out = tmp_path / "camera.yaml"
    assert main([str(tmp_path), *BOARD, "--out", str(out)]) == 1
    assert "To do better:" in capsys.readouterr().out
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nowhere.mp4"], "nowhere.mp4"),
        (["nowhere.mp4", "--board", "1x1"], "3 to 20"),
        (["nowhere.mp4", "--imu", "nowhere.csv"], "nowhere.csv"),
        (["--write-board", "board.tiff"], ".svg, .pdf or .png"),
    ],
)
def test_what_cannot_be_used_is_named(words, told, capsys):
    assert main(words) == 2
    assert told in capsys.readouterr().err


def test_a_board_is_written_without_a_film(tmp_path):
    for suffix in ("svg", "pdf", "png"):
        assert main(["--board-svg", str(tmp_path / f"board.{suffix}")]) == 0
        assert (tmp_path / f"board.{suffix}").stat().st_size > 1000


def test_of_a_board_that_was_never_found_no_blur_is_told(tmp_path, capsys):
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((240, 320), 90, np.uint8))
    assert main([str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert "The board was found in 0 of 3 pictures." in said
    assert "blurred:" not in said
