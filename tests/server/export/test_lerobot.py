"""LeRobotDataset v3.0, as pyarrow, FFmpeg and lerobot-doctor read it."""

import json
from dataclasses import replace
from itertools import chain, repeat

import av
import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from lerobot_doctor.cli import main as doctor
from mcap.reader import make_reader

from hardware.camera_file import CAMERAS, load_camera
from hardware.robot_file import load_robot
from pipeline.frames import R_co, R_from_wxyz
from server.export.command import main
from server.protocol.wire import decode, encode
from server.protocol.wire_records import Touch
from tests.server.export.recordings import (
    FLIGHT,
    TWIST_IN_B,
    ZERO_NS,
    film,
    on_a_known_day,
    told_a_twist,
)

RELEASED_S = 3.0, 4.2
"""The finger leaves for 50 ms at each of these times."""
TASKS = ["follow", "put it back"]
"""Of the first, which nobody named, and of the last."""
SAID = [
    (4.0, b'{"type":"task","text":"put it back"}'),
    (4.1, b'{"type":"verdict","press":2,"keep":false}'),
]


def three_presses(entry):
    """The flight, but in three episodes."""
    if entry.topic != "phone/records":
        return entry.data
    record = decode(entry.data)
    if not isinstance(record.body, Touch):
        return entry.data
    before = sum(entry.t > t for t in RELEASED_S)
    is_free = any(t < entry.t < t + 0.05 for t in RELEASED_S)
    held, press = record.body.held and not is_free, record.body.press + before
    return encode(replace(record, body=replace(record.body, held=held, press=press)))


class Dataset:
    """What a stranger finds in it."""

    def __init__(self, root):
        self.root, self.info = root, json.loads((root / "meta/info.json").read_text())
        place = {"chunk_index": 0, "file_index": 0}
        self.rows = pq.read_table(root / self.info["data_path"].format(**place)).to_pylist()
        episodes = root / "meta/episodes/chunk-000/file-000.parquet"
        self.episodes = pq.read_table(episodes).to_pylist()
        self.tasks = pq.read_table(root / "meta/tasks.parquet")
        self.stats = json.loads((root / "meta/stats.json").read_text())
        key = "observation.images.phone"
        with av.open(str(root / self.info["video_path"].format(video_key=key, **place))) as video:
            frames = list(video.decode(video=0))
            self.times = [float(frame.pts * frame.time_base) for frame in frames]
            self.pictures = [frame.to_ndarray(format="gray") for frame in frames]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    source = on_a_known_day(folder, change=three_presses, notes=SAID)
    words = ["--to", "lerobot", "--out", str(folder), "--task", "follow"]
    assert main([str(source), *words]) == 0
    return Dataset(folder / "virtual_phone.lerobot")


@pytest.mark.slow
def test_lerobot_doctor_finds_no_error(flight, capsys):
    doctor(["check", str(flight.root), "--json"])
    report = json.loads(capsys.readouterr().out)
    severities = {one["name"]: one["severity"] for one in report["checks"]}
    assert len(severities) > 8
    assert "FAIL" not in severities.values()


@pytest.mark.slow
def test_rows_pictures_and_episodes_fit_together(flight):
    assert (flight.info["codebase_version"], flight.info["fps"]) == ("v3.0", 20)
    assert len(flight.episodes) == flight.info["total_episodes"] == 2  # one of three is discarded
    assert len(flight.rows) == len(flight.pictures) == flight.info["total_frames"]
    assert [row["index"] for row in flight.rows] == list(range(len(flight.rows)))
    assert flight.times == pytest.approx([k / 20 for k in range(len(flight.rows))], abs=1e-6)
    for k, episode in enumerate(flight.episodes):
        begin, end = episode["dataset_from_index"], episode["dataset_to_index"]
        rows = flight.rows[begin:end]
        assert {row["episode_index"] for row in rows} == {k}
        assert [row["frame_index"] for row in rows] == list(range(episode["length"]))
        first = episode["videos/observation.images.phone/from_timestamp"]
        asked = [first + row["timestamp"] for row in rows]  # as LeRobot looks for its pictures
        assert asked == pytest.approx(flight.times[begin:end], abs=1e-4)
        assert episode["tasks"] == [TASKS[k]]
        assert {row["task_index"] for row in rows} == {k}
    assert flight.tasks.to_pydict() == {"task_index": [0, 1], "task": TASKS}
    assert json.loads(flight.tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]


@pytest.mark.slow
def test_the_discarded_episode_is_the_one_that_is_missing(flight):
    times = np.array([row["capture_time_s"] for row in flight.rows]) - 1e-9 * ZERO_NS
    assert np.all((times < RELEASED_S[0] + 0.1) | (times > RELEASED_S[1]))
    assert times[0] < RELEASED_S[0] - 1.0
    assert times[-1] > 5.0


@pytest.mark.slow
def test_true_times_stand_beside_the_nominal_ones(flight):
    first = flight.episodes[0]["length"]
    times = np.array([row["capture_time_s"] for row in flight.rows])
    assert np.diff(times[:first]) == pytest.approx(0.05, abs=2e-3)
    acting = np.array([row["acting_time_s"] for row in flight.rows])
    assert np.all(acting >= times - 1e-6)
    assert np.max(acting - times) < 0.021  # control tells of itself at 50 Hz
    assert all(0.0 < row["capture_sigma_s"] < 0.03 for row in flight.rows)


@pytest.mark.slow
def test_states_are_of_the_moment_of_their_pictures(flight):
    """By the raw record: between the two ticks of control about the time each was taken."""
    with FLIGHT.open("rb") as stream:
        messages = make_reader(stream).iter_messages(["control/status"])
        ticks = [json.loads(message.data) for _, _, message in messages]
    known = [tick for tick in ticks if tick["p_bc_in_c"] is not None]
    t, place = np.array([k["t"] for k in known]), np.array([k["p_bc_in_c"] for k in known])
    for row in flight.rows:
        taken = row["capture_time_s"] - 1e-9 * ZERO_NS
        between = [np.interp(taken, t, column) for column in place.T]
        assert row["observation.state"][:3] == pytest.approx(between, abs=2e-6)
        acting = min(tick["t"] for tick in ticks if tick["t"] >= taken)
        assert row["acting_time_s"] - 1e-9 * ZERO_NS == pytest.approx(acting, abs=1e-6)
        (told,) = [tick["thrusts"] for tick in ticks if tick["t"] == acting]
        assert row["action"] == pytest.approx(told, abs=1e-6)


@pytest.mark.slow
def test_leds_by_the_states_stand_where_they_are_in_the_pictures(flight):
    _, camera = load_camera(CAMERAS / "virtual_phone.yaml")
    leds = load_robot("ames").robot.leds_in_b
    errors = []
    for row, picture in list(zip(flight.rows, flight.pictures, strict=True))[::3]:
        state = np.array(row["observation.state"])
        in_o = (state[:3] + leds @ R_from_wxyz(state[3:7]).T) @ R_co
        pixels = cv2.projectPoints(in_o, np.zeros(3), np.zeros(3), camera.K, camera.distortion)[0]
        lit = np.asarray(picture > 128, dtype=np.uint8)
        spots = cv2.connectedComponentsWithStats(lit)[3][1:]
        errors += np.linalg.norm(spots - pixels, axis=2).min(axis=1).tolist()
    assert np.median(errors) < 1.0


@pytest.mark.slow
def test_features_are_described_and_their_statistics_are_theirs(flight):
    features = flight.info["features"]
    assert features["observation.images.phone"]["shape"] == [720, 1280, 3]
    for name, feature in features.items():
        if feature["dtype"] == "video":
            continue
        column = np.array([row[name] for row in flight.rows]).reshape(len(flight.rows), -1)
        assert [column.shape[1]] == feature["shape"]
        assert len(feature["names"] or [0]) == column.shape[1]
        assert flight.stats[name]["mean"] == pytest.approx(column.mean(0), rel=1e-5, abs=1e-6)
        assert flight.stats[name]["count"] == [len(column)]
    colours = flight.stats["observation.images.phone"]
    assert np.shape(colours["mean"]) == (3, 1, 1)
    mean = np.mean([picture.mean() for picture in flight.pictures]) / 255.0
    assert np.mean(colours["mean"]) == pytest.approx(mean, abs=0.02)


@pytest.mark.slow
def test_of_a_robot_that_takes_a_twist_that_is_the_action(tmp_path):
    words = ["--to", "lerobot", "--out", str(tmp_path)]
    assert main([str(told_a_twist(tmp_path)), *words]) == 0
    dataset = Dataset(tmp_path / "virtual_phone.lerobot")
    assert dataset.info["features"]["action"]["names"][0] == "told_vx_m_s"
    assert {tuple(row["action"]) for row in dataset.rows} == {
        tuple(np.float32(TWIST_IN_B).tolist())
    }


@pytest.mark.slow
def test_a_tool_is_as_it_was_told_last(tmp_path):
    told = chain([None] * 150, [0.25], [None] * 20, [0.75], repeat(None))
    words = ["--to", "lerobot", "--out", str(tmp_path)]
    assert main([str(told_a_twist(tmp_path, told)), *words]) == 0
    dataset = Dataset(tmp_path / "virtual_phone.lerobot")
    assert dataset.info["features"]["action"]["names"][-1] == "tool_opening"
    openings = [row["action"][-1] for row in dataset.rows]
    assert openings[0] == 0.25
    assert openings[-1] == 0.75
    assert set(openings) == {0.25, 0.75}
    assert openings == sorted(openings)


def test_a_recording_without_an_episode_is_named(tmp_path, capsys):
    source = film(tmp_path, "jpeg")
    assert main([str(source), "--to", "lerobot", "--out", str(tmp_path / "out")]) == 1
    assert "no episode" in capsys.readouterr().err


def test_a_flight_without_an_episode_leaves_nothing_in_the_way_of_the_next(tmp_path, capsys):
    source = film(tmp_path, "jpeg")
    for _ in range(2):
        assert main([str(source), "--to", "lerobot", "--out", str(tmp_path / "out")]) == 1
        assert "holds no episode" in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []
