"""`examples/mavlink_copter`: a robot file that can be flown, and says who stops it."""

from __future__ import annotations

from pathlib import Path

from hardware.robot_file import COMMANDS, load_robot
from server.control.process import never_stops
from server.tools.robot import main

COPTER = Path(__file__).resolve().parents[2] / "examples" / "mavlink_copter" / "copter.toml"


def test_its_robot_file_can_not_be_armed_before_somebody_has_said_who_stops_it(capsys, tmp_path):
    assert "stopped_by" in never_stops(load_robot(COPTER, takes=COMMANDS))
    assert main(["check", str(COPTER), "--state", str(tmp_path)]) == 1
    assert "stopped_by" in capsys.readouterr().out


def test_it_can_be_flown_and_says_who_stops_it(capsys, tmp_path):
    mine = tmp_path / "copter.toml"
    mine.write_text(COPTER.read_text().replace("# stopped_by", "stopped_by"))
    copter = load_robot(mine, takes=COMMANDS)
    assert copter.link.kind == "mavlink"
    assert never_stops(copter) == ""
    assert main(["check", str(mine), "--state", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "stops: GUID_TIMEOUT = 0.1" in said
    assert "whoever is on its network can lead it" in said
