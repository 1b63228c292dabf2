"""`examples/ros2_base`: two processes, no launch file; the one leads the other, and it stops."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hardware.robot_file import COMMANDS, load_robot
from server.control.process import never_stops
from server.tools.robot import main

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "ros2_base"


def test_its_robot_file_can_be_flown_and_says_who_stops_it(capsys, tmp_path):
    base = load_robot(FOLDER / "base.toml", takes=COMMANDS)
    assert base.link.kind == "ros2"
    assert never_stops(base) == ""
    assert main(["check", str(FOLDER / "base.toml"), "--state", str(tmp_path)]) == 0
    assert "stops: its own time-out of 0.06 s" in capsys.readouterr().out


@pytest.mark.e2e
def test_the_simulated_base_is_led_in_a_circle_and_stopped(tmp_path):
    """As it comes, but for names of its own and this machine alone: others may try it, too."""
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
    }
    base = subprocess.Popen([sys.executable, folder / "simulated_base.py"], env=environment)
    try:
        led = subprocess.run(
            [sys.executable, folder / "lead.py"],
            env=environment,
            capture_output=True,
            text=True,
            timeout=60.0,
        )
    finally:
        base.kill()
        base.wait()
    said = re.fullmatch(r"at x (-?[\d.]+) m, y ([\d.]+) m, turned by (\d+)°; IDLE\n", led.stdout)
    assert said, led.stderr
    x, y, turned = float(said[1]), float(said[2]), math.radians(float(said[3]))
    assert turned > 1.0
    # on the circle of 0.4 m, wherever it has come to
    assert math.hypot(x, y - 0.4) == pytest.approx(0.4, abs=0.04)


def test_it_is_as_short_as_an_example_should_be():
    for name in ("lead.py", "simulated_base.py"):
        lines = (FOLDER / name).read_text().splitlines()
        assert sum(bool(line.strip()) for line in lines) < 50
