"""Where `lightleash locate` finds the robot."""

from fractions import Fraction

import av
import cv2
import numpy as np
import pytest
import yaml

from hardware.codec import Encoder
from hardware.sim.scenes.scene import SCENES, VGA
from hardware.sim.scenes.video import RenderedVideo
from pipeline.frames import R_co, R_from_wxyz
from pipeline.robot import Robot
from pipeline.signals import BodyImu, PhoneImu
from pipeline.vision_config import GatesConfig
from server.media.tables import load_imu
from server.phone.frame_pipeline import FramePipeline
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Codec, Picture
from server.tools.locate.optical import COLUMNS, SIGMAS, optical
from server.tools.locate.work import AHEAD_S
from tests.server.tools.locate.locating import (
    FRAMES,
    SEED,
    copied,
    error,
    errors,
    number,
    run,
    table,
)


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
    film = RenderedVideo(SCENES["typical"], seed=SEED, size=VGA, frames=FRAMES)
    encoder = Encoder(*VGA, 30.0, 1_000_000, "jpeg")
    frame_pipeline = FramePipeline(film.camera, _robot(film.leds_in_b), GatesConfig())
    phone, body = (load_imu(source / name) for name in ("imu.csv", "body.csv"))
    live, at = [], [0, 0]
    for k, row in enumerate(table(source / "times.csv")):
        luma = cv2.imread(str(source / row["frame"]), cv2.IMREAD_GRAYSCALE)
        data, _ = encoder.encode(luma)
        (folder / f"{k:03}.jpg").write_bytes(data)
        t = float(row["t_s"])
        for s in phone[at[0] : (stop := int(np.sum(phone[:, 0] <= t + AHEAD_S)))]:
            frame_pipeline.front_end.add_imu(PhoneImu(s[0], s[1:4], s[4:]))
        at[0] = stop
        for s in body[at[1] : (stop := int(np.sum(body[:, 0] <= t + AHEAD_S)))]:
            frame_pipeline.front_end.add_imu(BodyImu(s[0], s[1:4], s[4:]))
        at[1] = stop
        sent = EncodedFrame(t, t, k, Picture(Codec.JPEG, True, *VGA, 0, data))
        live.append(frame_pipeline.see([sent]).pose)
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
