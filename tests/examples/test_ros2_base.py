"""`examples/ros2_base`: two processes, no launch file; the one leads the other, and it stops."""

from __future__ import annotations

import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from hardware.robot_file import COMMANDS, load_robot
from server.control.process import never_stops
from server.tools.robot import main
from tests.e2e.witness import Witness, longest

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "ros2_base"
STOPPED = "stopped by itself: one of us was not heard for a while\n"


def test_its_robot_file_can_be_flown_and_says_who_stops_it(capsys, tmp_path):
    base = load_robot(FOLDER / "base.toml", takes=COMMANDS)
    assert base.link.kind == "ros2"
    assert never_stops(base) == ""
    assert main(["check", str(FOLDER / "base.toml"), "--state", str(tmp_path)]) == 0
    assert "stops: its own time-out of 0.06 s" in capsys.readouterr().out


@pytest.fixture
def led_base(tmp_path):
    """Base and who leads it, as they come, but for names of their own and this machine alone."""
    lab_base = pytest.importorskip(
        "tests.hardware.link.ros2.lab_base", reason="NO CYCLONE DDS: pip install 'lightleash[ros2]'"
    )
    folder = shutil.copytree(FOLDER, tmp_path / "example")
    text = (folder / "base.toml").read_text()
    assert text.count('namespace = "/"') == 1
    (folder / "base.toml").write_text(
        text.replace('namespace = "/"', f'namespace = "/p{os.getpid()}"')
    )
    environment = {
        **os.environ,
        "PYTHONPATH": str(FOLDER.parents[1]),
        "CYCLONEDDS_URI": lab_base.LOOPBACK,
        "PYTHONUNBUFFERED": "1",
    }
    with (
        closing(Witness()) as witness,
        subprocess.Popen([sys.executable, folder / "simulated_base.py"], env=environment) as base,
        subprocess.Popen(
            [sys.executable, folder / "lead.py"],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as leader,
    ):
        yield leader, base, witness
        leader.kill()
        base.kill()


def where_it_is(said):
    """Of the last line: how far from the circle of 0.4 m, and the angle it has turned by."""
    found = re.search(r"at x (-?[\d.]+) m, y (-?[\d.]+) m, turned by (\d+)°; IDLE\n$", said)
    assert found, said
    return abs(math.hypot(float(found[1]), float(found[2]) - 0.4) - 0.4), math.radians(
        float(found[3])
    )


@pytest.mark.e2e
def test_the_simulated_base_is_led_in_a_circle_and_stopped(led_base):
    leader, _, witness = led_base
    said = leader.communicate(timeout=60.0)[0]
    aside, turned = where_it_is(said)
    assert aside < 0.04  # wherever on the circle it has come to
    if STOPPED in said:  # who is away for longer than is borne, has his reason
        assert longest(witness.holes(), "others") > 0.06
    else:
        assert turned > 1.0


@pytest.mark.e2e
def test_whoever_is_not_heard_for_long_the_base_stands_and_its_leader_waits_for_it(led_base):
    leader, base, _ = led_base
    assert leader.stdout.readline() == "leads\n"
    time.sleep(1.0)
    silent(base, 1.0)
    assert leader.stdout.readline() == STOPPED
    silent(base, 1.5)  # for longer than zero is told to one that is heard
    assert where_it_is(leader.communicate(timeout=60.0)[0])[1] < 1.0  # 2.0, led to the end


def silent(base, seconds):
    base.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    base.send_signal(signal.SIGCONT)


def test_it_is_as_short_as_an_example_should_be():
    for name in ("lead.py", "simulated_base.py"):
        lines = (FOLDER / name).read_text().splitlines()
        assert sum(bool(line.strip()) for line in lines) < 50
