"""`examples/mavlink_copter`: a robot file that can be flown, and says who stops it."""

from __future__ import annotations

from pathlib import Path

from hardware.robot_file import COMMANDS, load_robot
from server.control.process import never_stops
from server.tools.robot import main

COPTER = Path(__file__).resolve().parents[2] / "examples" / "mavlink_copter" / "copter.toml"


def test_its_robot_file_can_be_flown_and_says_who_stops_it(capsys, tmp_path):
    copter = load_robot(COPTER, takes=COMMANDS)
    assert copter.link.kind == "mavlink"
    assert never_stops(copter) == ""
    assert main(["check", str(COPTER), "--state", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "stops: GUID_TIMEOUT = 0.1" in said
    assert "whoever is on its network can lead it" in said
