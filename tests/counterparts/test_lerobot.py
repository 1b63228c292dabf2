"""LeRobot itself loads the plug-in, moves a robot by it, records, and loads what it recorded."""

from __future__ import annotations

import json
import os
import re
import secrets
import shlex
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest

from hardware.follower import FollowerState, TwistCommand
from hardware.link.link_key import read_key, write_key
from hardware.link.registry import connect
from hardware.link.robot_end import SILENCE_US
from hardware.link.robot_server import TICK_US
from hardware.robot_file import COMMANDS, load_robot
from hardware.twist_schema import TOLD_ZERO_S
from pipeline.frames import Array
from server.export.command import main as export
from server.process.robot_key import key_file
from tests.counterparts.betaflight import FOLDER
from tests.counterparts.lab_body import RunningBody
from tests.e2e.serving import serving
from tests.server.export.recordings import FLIGHT

pytestmark = pytest.mark.counterpart
ROOT = Path(__file__).parents[2]
PLUG_IN, LAB = ROOT / "deploy" / "lerobot", Path(__file__).parent / "lerobot_lab"
PAGE = (ROOT / "docs" / "lerobot.md").read_text()
PLACE = FOLDER / "lerobot-0.4.4"
INSTALL_S, RECORD_S = 1500.0, 300.0
"""8 GB come from PyPI the first time, most of them torch's for graphics cards."""
LEADS_S, FPS = 6.0, 30
PHONE_S = 40.0
MOST_MM, MOVED_M = 20.0, 0.1
"""Of the phone's own view of the robot, ten times what was seen; and how far the hand leads it."""
RAMP_S = 0.2
"""From rest to full speed, within what the robot's file allows."""
SPEED = np.array([0.2, -0.1, 0.05, 0.1, -0.2, 0.3])
READ = """
import json, sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
d = LeRobotDataset("me/tip", root=sys.argv[1])
rows = d.hf_dataset.with_format(None)
print(json.dumps([d.meta.features["action"]["names"], rows["action"][:],
                  rows["observation.state"][:], rows["timestamp"][:], d.num_episodes]))
"""
ITEMS = """
import json, sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
root, *numbers = sys.argv[1:]
d = LeRobotDataset("me/flight", root=root, video_backend="pyav")
items = [d[int(number)] for number in numbers]
print(json.dumps([[i["action"].tolist(), i["observation.state"].tolist(), i["task"],
                   (255 * i["observation.images.phone"].mean((0, 1))).tolist()] for i in items]))
"""
"""What it loads of a dataset by the numbers of rows: numbers, task, and columns of the picture."""
LINT = "lerobot-lint==0.1.1"
OF_JOINTS = {
    *("DEAD_JOINT", "SATURATED_JOINT", "DISCONTINUITY"),
    *("ACTION_STATE_DIVERGENCE_CRASHED", "ACTION_RANGE_MISMATCH_CRASHED"),
}
"""Of checks that take a state for joints' angles, and an action for as many: ours is the pose and
velocity of a body that hovers, and thrusts. Times, rate, film and tasks are judged without them."""
MOST_GREY = 3.0
"""Between two decoders' grey [1/255]."""


def shown(after: str) -> list[str]:
    """Words of the command of the page that begins so."""
    (block,) = [one for one in re.findall(r"```sh\n(.*?)```", PAGE, re.S) if one.startswith(after)]
    return shlex.split(block.replace("\\\n", " "))


def bring(words: list[str], timeout: float) -> None:
    try:
        subprocess.run(words, check=True, capture_output=True, text=True, timeout=timeout, cwd=ROOT)
    except (OSError, subprocess.SubprocessError) as error:
        said = (getattr(error, "stderr", None) or "").strip().splitlines()[-1:]
        pytest.skip(f"LEROBOT NOT TESTED: {' '.join(words[-3:])}: {error} {said}")


@pytest.fixture(scope="module")
def programs() -> Path:
    """Folder of LeRobot's programs, in an environment of its own, installed as the page says."""
    programs = PLACE / "bin"
    first, second = (shlex.split(line)[1:] for line in re.findall(r"^pip (?:.*)$", PAGE, re.M))
    if not (PLACE / "whole").exists():
        bring([sys.executable, "-m", "venv", "--clear", str(PLACE)], INSTALL_S)
        bring([str(programs / "pip"), *first], INSTALL_S)
        (PLACE / "whole").touch()
    anew = ["--force-reinstall", "--no-deps", str(LAB)]
    bring([str(programs / "pip"), *second, *anew], INSTALL_S)
    return programs


class Control(threading.Thread):
    """Leads by the real link at 200 Hz as soon as the robot is ready, and then falls silent."""

    def __init__(self, robot_file, key):
        super().__init__(daemon=True)
        self.follower = connect(robot_file, key, time.time_ns() // 1_000_000)
        self.said, self.states, self.gone = [], [], threading.Event()
        self.state, self.leading_since = FollowerState.REFUSING, None

    def run(self):
        while not self.gone.is_set():
            for sample in self.follower.receive():
                self.state = sample.state
                self.states.append(sample.state)
            if self.state == FollowerState.IDLE and self.leading_since is None:
                self.leading_since = time.monotonic()
            led_s = time.monotonic() - (self.leading_since or np.inf)
            if led_s < LEADS_S:
                self._send(max(led_s, 0.0))
            time.sleep(0.005)
        self.follower.close()

    def _send(self, led_s):
        twist = np.zeros(6)
        if self.leading_since is not None:
            twist = SPEED * min(1.0, led_s / RAMP_S) * (0.75 + 0.25 * np.cos(2.0 * led_s))
        self.follower.send(TwistCommand(twist, armed=bool(twist.any())))
        self.said.append(twist)


@dataclass(frozen=True, slots=True, eq=False)
class Dataset:
    """What LeRobot reads of what it recorded."""

    names: list[str]
    actions: Array
    """(n, 8)."""
    places: Array
    """(n, 6)."""
    times: Array
    """(n,) [s]."""
    episodes: int


def prepared(folder: Path) -> Path:
    """A copy of the robot file, with a port that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    text = (PLUG_IN / "tip.toml").read_text()
    assert text.count("port = 47001") == 1
    (folder / "tip.toml").write_text(text.replace("port = 47001", f"port = {port}"))
    return folder / "tip.toml"


def record(programs: Path, folder: Path, **changed: str) -> Dataset:
    """Record as the page says but for some words, and read it."""
    words = [word.replace("MY_ROBOT", "lab_tip") for word in shown("lerobot-record")]
    words += [f"--{key.replace('__', '.')}={value}" for key, value in changed.items()]
    around = {**os.environ, "HF_HUB_OFFLINE": "1", "HOME": str(folder), "PYTHONPATH": ""}
    said = []
    for command in (words, ["python", "-c", READ, str(folder / "tip-dataset")]):
        done = subprocess.run(
            [str(programs / command[0]), *command[1:]],
            cwd=folder, env=around, capture_output=True, text=True, timeout=RECORD_S,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-3000:]
        said = done.stdout.splitlines()
    names, actions, places, times, episodes = json.loads(said[-1])
    return Dataset(names, np.array(actions), np.array(places), np.array(times), episodes)


@pytest.fixture(scope="module")
def led(programs, tmp_path_factory):
    """(what was recorded, what control said and heard): control itself, without a phone."""
    folder = tmp_path_factory.mktemp("lerobot")
    robot_file = load_robot(str(prepared(folder)), takes=COMMANDS)
    write_key(folder / "tip.key", secrets.token_bytes(16))
    control = Control(robot_file, read_key(folder / "tip.key"))
    control.start()
    try:
        return record(programs, folder), control
    finally:
        control.gone.set()
        control.join()


def test_it_records_one_episode_of_what_control_said_and_nothing_else(led):
    dataset, control = led
    axes = ("x", "y", "z", "wx", "wy", "wz")
    assert dataset.names == [*(f"{axis}.vel" for axis in axes), "enabled", "age_s"]
    assert dataset.episodes == 1
    enabled = dataset.actions[:, 6] == 1.0
    said = {tuple(np.float32(twist)) for twist in control.said}
    followed = [tuple(np.float32(row[:6])) for row in dataset.actions[enabled]]
    assert len(followed) > 3 * FPS
    assert set(followed) <= said
    assert len(set(followed)) > len(followed) // 2
    assert dataset.actions[enabled, 7].max() <= 1e-6 * (SILENCE_US + TICK_US)
    assert FollowerState.RUNNING in control.states


def test_after_control_fell_silent_nothing_is_enabled_and_soon_nothing_moves(led):
    dataset, control = led
    last = int(np.flatnonzero(dataset.actions[:, 6] == 1.0)[-1])
    after = dataset.actions[last + 1 :]
    assert len(after) > FPS
    assert not after[:, 6].any()
    assert not after[after[:, 7] > TOLD_ZERO_S, :6].any()
    assert (np.diff(after[:, 7]) > 0.0).all()
    assert control.states[-1] == FollowerState.REFUSING


def test_a_phone_leads_lerobots_robot_by_the_real_server(programs, tmp_path):
    """Camera, pairing, control, the plug-in, LeRobot, its robot, what the phone sees of it."""
    file = prepared(tmp_path)
    robot_file = load_robot(str(file), takes=COMMANDS)
    key = key_file(tmp_path / "state" / "lightleash", robot_file.robot.name)
    (tmp_path / "state").mkdir(mode=0o700)
    write_key(key, secrets.token_bytes(16))
    body = RunningBody(robot_file)
    words = [sys.executable, "-m", "server", "phone", "--seconds", f"{PHONE_S}"]
    words += ["--robot", str(file), "--truth-port", str(body.truth_port)]
    with serving(tmp_path, "--robot", str(file), "--no-simulate") as server:
        phone = subprocess.Popen(
            words, env=server.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        dataset = record(
            programs, tmp_path,
            teleop__key=str(key), robot__port=str(body.port), dataset__episode_time_s=f"{PHONE_S}",
        )  # fmt: skip
        said, complaints = phone.communicate(timeout=RECORD_S)
    body.close()
    assert phone.returncode == 0, complaints
    phone_says = json.loads(said.splitlines()[-1])
    enabled = dataset.actions[:, 6] == 1.0
    assert enabled.sum() > 3 * FPS
    assert phone_says["tracked_s"] > 3.0
    assert phone_says["rms_mm"] < MOST_MM
    path = np.array(body.lab.path)
    assert np.ptp(path, axis=0).max() > MOVED_M


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> Path:
    """A recorded flight, as a dataset of one episode."""
    folder = tmp_path_factory.mktemp("exported")
    words = ["--to", "lerobot", "--out", str(folder), "--task", "follow"]
    assert export([str(FLIGHT), *words]) == 0
    return folder / "virtual_phone.lerobot"


def ran(programs: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """One of LeRobot's programs, without the internet, to its end."""
    around = {**os.environ, "HF_HUB_OFFLINE": "1", "HOME": str(folder), "PYTHONPATH": ""}
    return subprocess.run(
        [str(programs / words[0]), *words[1:]],
        cwd=folder, env=around, capture_output=True, text=True, timeout=RECORD_S,
    )  # fmt: skip


def test_lerobot_loads_the_first_the_last_and_any_item_of_an_export(programs, exported, tmp_path):
    rows = pq.read_table(exported / "data/chunk-000/file-000.parquet").to_pylist()
    with av.open(str(next(exported.glob("videos/**/*.mp4")))) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    numbers = [0, len(rows) - 1, *np.random.default_rng(0).integers(0, len(rows), 3).tolist()]
    done = ran(programs, tmp_path, "python", "-c", ITEMS, str(exported), *map(str, numbers))
    assert done.returncode == 0, done.stderr[-3000:]
    items = json.loads(done.stdout.splitlines()[-1])
    for number, (action, state, task, columns) in zip(numbers, items, strict=True):
        assert action == pytest.approx(rows[number]["action"], abs=1e-6)
        assert state == pytest.approx(rows[number]["observation.state"], abs=1e-6)
        assert task == "follow"
        assert columns == pytest.approx(pictures[number].mean((0, 2)), abs=MOST_GREY)


def test_lerobot_lint_finds_nothing_but_that_a_pose_is_no_row_of_joints(
    programs, exported, tmp_path
):
    for words in (["--no-deps", LINT], ["typer", "rich", "pyyaml"]):  # it is content with 0.4.4
        bring([str(programs / "pip"), "install", "--quiet", *words], INSTALL_S)
    report = tmp_path / "report.json"
    done = ran(programs, tmp_path, "lelint", "check", str(exported), "--json", str(report))
    assert report.exists(), done.stderr[-3000:]
    findings = json.loads(report.read_text())["findings"]
    assert {one["check"] for one in findings if one["severity"] == "error"} <= OF_JOINTS
    assert {one["check"] for one in findings if one["severity"] == "warning"} <= OF_JOINTS
