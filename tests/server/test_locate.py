import csv
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest
import yaml

from hardware.sim.codec import Encoder
from hardware.sim.scenes import SCENES, VGA
from hardware.sim.scenes_film import Film
from pipeline.frames import R_co, R_from_wxyz, log
from pipeline.robot import Robot
from pipeline.signals import BodyImu, PhoneImu
from pipeline.vision.felt import STALE_S, Felt
from pipeline.vision_config import GatesConfig
from server.bench.write import write_film
from server.cli import main
from server.films.tables import load_imu
from server.ingest import EncodedFrame
from server.locate.optical import COLUMNS, SIGMAS, optical
from server.locate.work import AHEAD_S
from server.sight import Sight
from server.wire import Codec, Picture

FRAMES, SEED = 24, 7


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    """Folders of frames, motion samples, camera and robot file, truth; by scene."""
    folders = {}
    for name in ("typical", "rolling_shutter"):
        folder = tmp_path_factory.mktemp(name)
        write_film(Film(SCENES[name], seed=SEED, size=VGA, frames=FRAMES), folder)
        folders[name] = folder
    return folders


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


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["typical", "rolling_shutter"])
def test_poses_are_where_the_robot_was_and_as_sure_as_they_say(films, tmp_path, scene, capsys):
    folder, out, npz = films[scene], tmp_path / "poses.csv", tmp_path / "C.npz"
    assert run(folder, out, "--covariance", npz) == 0
    assert out.read_text().splitlines()[0] == ",".join(COLUMNS)
    rows, wrong = table(out), errors(out, folder)
    assert len(wrong) >= 0.9 * FRAMES
    median = np.median(np.abs(wrong), axis=0)
    assert median[:2].max() < 0.002
    assert median[2] < 0.015
    assert median[3:].max() < np.deg2rad(0.5)
    kept = np.load(npz)
    found = kept["found"]
    assert [int(row["found"]) for row in rows] == found.astype(int).tolist()
    assert kept["frame"].tolist() == [row["frame"] for row in rows]
    np.testing.assert_allclose(kept["t_s"], [float(row["t_s"]) for row in rows])
    assert np.isnan(kept["covariance"][~found]).all()
    C = kept["covariance"][found]
    nees = np.einsum("ni,nij,nj->n", wrong, np.linalg.inv(C), wrong) / 6.0
    assert 0.1 < np.median(nees) < 4.0
    sigmas = np.array([number(row, *SIGMAS) for row in rows if row["found"] == "1"])
    np.testing.assert_allclose(sigmas**2, np.diagonal(C, axis1=1, axis2=2), rtol=1e-3)
    assert (tmp_path / "poses.png").stat().st_size > 10_000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["C.npz", "poses.csv", "poses.png"]
    said = capsys.readouterr()
    assert f"found          {found.sum()}" in said.out
    assert "100 %" in said.err


@pytest.mark.slow
def test_depth_is_dated_by_the_readout(films, tmp_path):
    """With the wrong sign of the readout time the rows are wrongly dated: poses get worse."""
    folder = films["rolling_shutter"]
    camera = yaml.safe_load((folder / "camera.yaml").read_text())
    assert camera["rolling_shutter_readout_s"] > 0.005
    camera["rolling_shutter_readout_s"] *= -1
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(camera))
    spread = {}
    for name, file in (("right", folder / "camera.yaml"), ("wrong", tmp_path / "wrong.yaml")):
        out = tmp_path / f"{name}.csv"
        assert run(folder, out, "--no-plot", camera=file) == 0
        wrong = errors(out, folder)
        spread[name] = np.median(np.linalg.norm(wrong[:, :3], axis=1)) if len(wrong) else np.inf
    assert spread["right"] < 0.7 * spread["wrong"]


@pytest.mark.slow
def test_a_kalibr_camchain_gives_the_same_poses(films, tmp_path):
    folder = films["rolling_shutter"]
    info = yaml.safe_load((folder / "camera.yaml").read_text())
    K, D = info["camera_matrix"]["data"], info["distortion_coefficients"]["data"]
    info["distortion_coefficients"]["data"] = D[:4]  # Kalibr knows no more
    height, readout = info["image_height"], info["rolling_shutter_readout_s"]
    chain = {
        "cam0": {
            "T_cam_imu": np.eye(4).tolist(),
            "camera_model": "pinhole",
            "distortion_coeffs": D[:4],
            "distortion_model": "radtan",
            "intrinsics": [K[0], K[4], K[2], K[5]],
            "resolution": [info["image_width"], height],
            "line_delay": readout / height,
            "rostopic": "/cam0/image_raw",
        }
    }
    poses = {}
    for name, camera in (("info", info), ("kalibr", chain)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(camera))
        out = tmp_path / f"{name}.csv"
        assert run(folder, out, "--no-plot", camera=tmp_path / f"{name}.yaml") == 0
        poses[name] = [
            {k: v for k, v in row.items() if not k.endswith("_us")} for row in table(out)
        ]
    assert poses["info"] == poses["kalibr"]


@pytest.mark.slow
def test_it_sees_what_the_live_pipeline_sees(films, tmp_path):
    """The same JPEGs and motion samples through the live path give the very same poses."""
    folder = copied(films["typical"], tmp_path / "film", "camera.yaml", "robot.toml")
    source = films["typical"]
    film = Film(SCENES["typical"], seed=SEED, size=VGA, frames=FRAMES)
    encoder = Encoder(*VGA, 30.0, 1_000_000, "jpeg")
    sight = Sight(film.camera, _robot(film.leds_in_b), GatesConfig())
    phone, body = (load_imu(source / name) for name in ("imu.csv", "body.csv"))
    felt, live, at = Felt(), [], [0, 0]
    for k, row in enumerate(table(source / "times.csv")):
        luma = cv2.imread(str(source / row["frame"]), cv2.IMREAD_GRAYSCALE)
        data, _ = encoder.encode(luma)
        (folder / f"{k:03}.jpg").write_bytes(data)
        t = float(row["t_s"])
        for s in phone[at[0] : (stop := int(np.sum(phone[:, 0] <= t + AHEAD_S)))]:
            sight.feel(PhoneImu(s[0], s[1:4], s[4:]))
        at[0] = stop
        for s in body[at[1] : (stop := int(np.sum(body[:, 0] <= t + AHEAD_S)))]:
            felt.add(s[0], s[1:4], s[4:])
            sight.feel_body([BodyImu(s[0], s[1:4], s[4:])])
        at[1] = stop
        sent = EncodedFrame(t, t, k, Picture(Codec.JPEG, True, *VGA, 0, data))
        known = felt.at(t + sight.looking.offset_s)
        live.append(sight.see([sent], known.up, known.omega).pose)
    times = [f"{k:03}.jpg,{row['t_s']}" for k, row in enumerate(table(source / "times.csv"))]
    (folder / "times.csv").write_text("\n".join(["frame,t_s", *times]) + "\n")
    out = tmp_path / "poses.csv"
    motion = ("--imu", source / "imu.csv", "--body-imu", source / "body.csv")
    assert run(folder, out, "--no-plot", *motion, imu=False) == 0
    assert sum(pose is not None for pose in live) >= 0.9 * FRAMES
    for row, pose in zip(table(out), live, strict=True):
        assert row["found"] == str(int(pose is not None))
        if pose is not None:
            seen = optical(pose)
            np.testing.assert_allclose(number(row, "x_m", "y_m", "z_m"), seen.p_bo_in_o, atol=1e-8)
            R = R_co @ R_from_wxyz(number(row, "qw", "qx", "qy", "qz"))
            np.testing.assert_allclose(R, pose.R_cb, atol=1e-7)
            np.testing.assert_allclose(number(row, *SIGMAS), seen.sigmas, rtol=1e-4)


def _robot(leds_in_b):
    nothing = np.zeros((6, 1))
    axes = np.ones(6, dtype=bool)
    return Robot("rig", leds_in_b, nothing, 0.0, 1.0, 1.0, np.ones(3), axes, True, 1.0)


@pytest.mark.slow
def test_a_film_is_as_good_as_a_folder(films, tmp_path):
    folder, path = films["typical"], tmp_path / "film.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(
            "libx264", rate=30, options={"crf": "8", "preset": "ultrafast"}
        )
        stream.width, stream.height = VGA
        stream.pix_fmt = "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 90_000)
        for row in table(folder / "times.csv"):
            luma = cv2.imread(str(folder / row["frame"]), cv2.IMREAD_GRAYSCALE)
            frame = av.VideoFrame.from_ndarray(luma, format="gray").reformat(format="yuv420p")
            frame.pts, frame.time_base = round(90_000 * float(row["t_s"])), Fraction(1, 90_000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    out = tmp_path / "poses.csv"
    assert run(folder, out, "--no-plot", frames=path) == 0
    rows, truth = table(out), table(folder / "truth.csv")
    assert [row["frame"] for row in rows] == [f"{k:06d}" for k in range(FRAMES)]
    np.testing.assert_allclose(
        [float(row["t_s"]) for row in rows], [float(row["t_s"]) for row in truth], atol=1e-3
    )
    wrong = [error(*p) for p in zip(rows, truth, strict=True) if p[0]["found"] == "1"]
    assert len(wrong) >= 0.9 * FRAMES
    assert np.median(np.linalg.norm(np.array(wrong)[:, :3], axis=1)) < 0.01


@pytest.mark.slow
def test_what_was_seen_is_drawn(films, tmp_path):
    folder = films["typical"]
    assert run(folder, tmp_path / "poses.csv", "--no-plot", "--overlay", tmp_path / "seen") == 0
    drawn = sorted((tmp_path / "seen").iterdir())
    assert [file.name for file in drawn] == [f"{k:05}.jpg" for k in range(FRAMES)]
    picture = cv2.imread(str(drawn[3])).astype(int)
    assert picture.shape == (VGA[1], VGA[0], 3)
    green = (picture[..., 1] - picture[..., 2] > 60) & (picture[..., 1] - picture[..., 0] > 30)
    assert green.sum() > 100


def test_without_motion_sensors_it_works_and_says_so(films, tmp_path, capsys):
    folder, out = films["typical"], tmp_path / "poses.csv"
    assert run(folder, out, "--no-plot", imu=False) == 0
    assert "no motion samples" in capsys.readouterr().err
    for option, missing in (("--imu", "no --body-imu"), ("--body-imu", "no --imu")):
        file = folder / ("imu.csv" if option == "--imu" else "body.csv")
        assert run(folder, out, "--no-plot", option, file, imu=False) == 0
        assert missing in capsys.readouterr().err


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
    "bad fps": (["--fps", "0"], None, "--fps: '0': allowed: 0.01 to 10000"),
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
        code = exit_.code
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
