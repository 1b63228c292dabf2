"""What `lightleash locate` says, and which words it refuses."""

import sys

import cv2
import numpy as np
import pytest

from hardware.sim.scenes.scene import VGA
from pipeline.vision.imu_buffer import STALE_S
from server.cli import main
from server.media.tables import load_imu
from server.tools.locate.optical import COLUMNS
from tests.server.tools.locate.locating import FRAMES, copied, run, table


def test_without_motion_sensors_it_works_and_says_so(films, tmp_path, capsys):
    folder, out = films["typical"], tmp_path / "poses.csv"
    assert run(folder, out, "--no-plot", imu=False) == 0
    assert "no motion samples" in capsys.readouterr().err
    for option, missing in (("--imu", "no --body-imu"), ("--body-imu", "no --imu")):
        file = folder / ("imu.csv" if option == "--imu" else "body.csv")
        assert run(folder, out, "--no-plot", option, file, imu=False) == 0
        assert missing in capsys.readouterr().err


def test_without_matplotlib_poses_are_written_all_the_same(films, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert run(films["typical"], tmp_path / "poses.csv") == 0
    assert len(table(tmp_path / "poses.csv")) == FRAMES
    assert [path.name for path in tmp_path.iterdir()] == ["poses.csv"]
    told = capsys.readouterr()
    assert "pip install 'lightleash[plots]'" in told.err
    assert told.out.endswith("written: " + str(tmp_path / "poses.csv") + "\n")


def test_frames_that_show_nothing_or_cannot_be_read_are_rows_without_a_pose(
    films, tmp_path, capsys
):
    folder = copied(films["typical"], tmp_path / "film")
    (folder / "00004.png").write_bytes(b"torn")
    cv2.imwrite(str(folder / "00007.png"), np.full(VGA[::-1], 30, np.uint8))
    out = tmp_path / "poses.csv"
    assert run(folder, out, "--no-plot") == 0
    rows = table(out)
    assert len(rows) == FRAMES
    assert rows[4] == dict.fromkeys(COLUMNS, "") | {
        "frame": "00004.png",
        "t_s": rows[4]["t_s"],
        "found": "0",
    }
    assert (rows[7]["found"], rows[7]["leds"], rows[7]["x_m"]) == ("0", "0", "")
    said = capsys.readouterr().out
    assert "unreadable     1" in said
    assert "1  The file can't be read as a picture." in said
    assert "bright enough" in said


REFUSALS = {
    "no frames": (["--imu", "{}/imu.csv"], "missing", "no such folder or film"),
    "another clock": (["--imu", "{tmp}/late.csv"], None, "late.csv, t_s: 500.000 to 501.000 s"),
    "no camera": (["--camera", "{tmp}/none.yaml"], None, "none.yaml: No such file"),
    "another size": (["--camera", "{tmp}/large.yaml"], None, "00000.png: is 640x480, but"),
    "no leds": (["--robot", "{tmp}/none.toml"], None, "none.toml: No such file"),
    "bad fps": (["--fps", "0"], None, "--fps: 0: allowed: 0.01 to 10000"),
    "bad plot": (["--plot", "a.gif"], None, "allowed: .png, .pdf, .svg"),
    "nowhere": (["--out", "{tmp}/none/poses.csv"], None, "--out: there is no folder"),
    "over an input": (["--covariance", "{}/camera.yaml"], None, "--covariance: "),
    "among the frames": (["--out", "{}/poses.csv"], None, "would lie among the frames"),
    "overlay on frames": (["--overlay", "{}"], None, "would lie among the frames"),
    "overlay on a file": (["--overlay", "{tmp}/late.csv"], None, "must be a folder"),
    "unknown option": (["--cam"], None, "--cam"),
}


@pytest.mark.parametrize(("options", "frames", "words"), REFUSALS.values(), ids=REFUSALS)
def test_a_refusal_is_one_line_and_leaves_nothing_behind(
    films, tmp_path, capsys, options, frames, words
):
    folder = films["typical"]
    (tmp_path / "late.csv").write_text(
        "t_s,gx,gy,gz,ax,ay,az\n500,0,0,0,0,0,9.8\n501,0,0,0,0,0,9.8\n"
    )
    large = (folder / "camera.yaml").read_text().replace("width: 640", "width: 800")
    (tmp_path / "large.yaml").write_text(large)
    before = {path for place in (tmp_path, folder) for path in place.iterdir()}
    options = [word.replace("{tmp}", str(tmp_path)).replace("{}", str(folder)) for word in options]
    code = 0
    try:
        frames = tmp_path / frames if frames else None
        code = run(folder, tmp_path / "poses.csv", *options, frames=frames, imu=False)
    except SystemExit as exit_:
        code = exit_.code  # type: ignore[assignment]
    assert code == 2
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("note:")]
    assert len(said) == 1
    assert said[0].startswith("lightleash locate: ")
    assert words in said[0]
    assert {path for place in (tmp_path, folder) for path in place.iterdir()} == before


def test_a_frame_of_another_size_amid_the_others_leaves_old_results_alone(films, tmp_path, capsys):
    folder, out = copied(films["typical"], tmp_path / "film"), tmp_path / "poses.csv"
    cv2.imwrite(str(folder / "00009.png"), np.zeros((100, 100), np.uint8))
    out.write_text("of an earlier run")
    assert run(folder, out, "--overlay", tmp_path / "seen") == 2
    assert "00009.png: is 100x100" in capsys.readouterr().err
    assert out.read_text() == "of an earlier run"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["film", "poses.csv"]


def test_motion_samples_for_only_some_of_the_frames_are_told_of(films, tmp_path, capsys):
    folder = films["typical"]
    lines = (folder / "imu.csv").read_text().splitlines()
    samples = load_imu(folder / "imu.csv")
    begun = float(table(folder / "times.csv")[2]["t_s"])
    kept = [lines[0], *(line for line, s in zip(lines[1:], samples, strict=True) if s[0] < begun)]
    (tmp_path / "short.csv").write_text("\n".join(kept) + "\n")
    options = ("--imu", tmp_path / "short.csv", "--body-imu", folder / "body.csv", "--no-plot")
    assert run(folder, tmp_path / "poses.csv", *options, imu=False) == 0
    last = max(s[0] for s in samples if s[0] < begun)
    unknown = sum(float(row["t_s"]) > last + STALE_S for row in table(folder / "times.csv"))
    assert unknown > 5
    said = capsys.readouterr().err
    assert f"short.csv says nothing about {unknown} of {FRAMES} frames" in said


def test_three_leds_are_too_few_to_start_from_and_that_is_said(films, tmp_path, capsys):
    folder = films["typical"]
    words = (folder / "robot.toml").read_text().split("[[leds]]")
    (tmp_path / "three.toml").write_text("[[leds]]".join(words[:4]))
    robot, out = tmp_path / "three.toml", tmp_path / "poses.csv"
    assert run(folder, out, "--no-plot", robot=robot) == 0
    assert "3 LEDs: without a pose to start from 4 must be seen" in capsys.readouterr().err
    assert {row["found"] for row in table(out)} == {"0"}


def test_help_tells_the_formats(capsys):
    with pytest.raises(SystemExit) as exit_:
        main(["locate", "--help"])
    assert exit_.value.code == 0
    said = capsys.readouterr().out
    for word in ("times.csv", "frame,t_s", "t_s,gx,gy,gz,ax,ay,az", "rolling_shutter_readout_s"):
        assert word in said
