"""`lightleash tune`: finds, flies, writes; refuses before it works."""

from __future__ import annotations

import shutil

import pytest

from hardware.robot_file import ROBOTS, load_robot
from server.simulation.session import Figures, SessionOutcome
from server.tools.tune import command


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.toml"
    shutil.copy(ROBOTS / "ground.toml", path)
    return path


@pytest.mark.slow
def test_a_set_is_found_flown_and_written_into_the_robots_own_file(mine, capsys, monkeypatch):
    monkeypatch.setattr(command, "SECONDS", 5.0)
    text = mine.read_text()
    words = [str(mine), "--latency-ms", "120", "--flights", "1", "--phase-margin", "45"]
    assert command.main(words) == 0
    told = capsys.readouterr().out
    robot_file = load_robot(mine)
    assert list(robot_file.gains) == ["phone", "tuned_120ms"]
    assert robot_file.gains["tuned_120ms"].Kp[5] > robot_file.gains["phone"].Kp[5]
    assert all(line in mine.read_text() for line in text.splitlines())
    assert "45 degrees, peak 2" in mine.read_text()
    rows = [line.split() for line in told.splitlines() if line.split()[:1] == ["tuned_120ms"]]
    assert [row[1] for row in rows] == ["x", "y", "yaw"]
    assert all(float(row[6]) >= 45.0 and float(row[8]) <= 2.0 for row in rows)
    assert "tracking RMS, hand moving: phone " in told
    assert command.main(words) == 2
    assert "--replace" in capsys.readouterr().err


def test_a_file_of_another_system_keeps_its_line_ends(mine, monkeypatch):
    before = mine.read_bytes().replace(b"\n", b"\r\n")
    mine.write_bytes(before)
    robot_file = load_robot(mine)
    monkeypatch.setattr(command, "tuned", lambda *_: robot_file.gains["phone"])
    flown = Figures(3.0, 4.0, chatter_n=0.1)
    monkeypatch.setattr(command, "fly", lambda session: SessionOutcome(session.index, flown, 0.1))
    assert command.main([str(mine), "--latency-ms", "90", "--name", "late"]) == 0
    written = mine.read_bytes()
    assert b"[gains.late]" in written
    assert written.count(b"\r\n") == written.count(b"\n") == before.count(b"\n") + 5
    assert set(before.splitlines(keepends=True)) <= set(written.splitlines(keepends=True))


def test_what_does_not_fly_is_not_written(mine, capsys, monkeypatch):
    text = mine.read_text()
    robot_file = load_robot(mine)
    monkeypatch.setattr(command, "tuned", lambda *_: robot_file.gains["phone"])

    def fallen(session):
        ended = "lost" if dict(session.settings)["gains.set"] == "late" else ""
        return SessionOutcome(session.index, Figures(3.0, 4.0, chatter_n=0.1, ended=ended), 0.1)

    monkeypatch.setattr(command, "fly", fallen)
    assert command.main([str(mine), "--latency-ms", "90", "--name", "late"]) == 1
    said = capsys.readouterr()
    assert "late ended: lost" in said.out
    assert "nothing is written" in said.err
    assert mine.read_text() == text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["ames", "--latency-ms", "90"], "ames is built in: --out FILE.toml"),
        (["amse", "--latency-ms", "90"], "did you mean 'ames'?"),
        (["ames", "--latency-ms", "90", "--out", "x.json"], "a path ending in .toml"),
        (["MINE", "--latency-ms", "90", "--name", "phone"], "is there already"),
        (["MINE", "--latency-ms", "90", "--name", "A b"], "allowed: up to 32"),
        (["MINE", "--latency-ms", "90", "--from", "sport"], "'sport' is not one of phone"),
        (["ames", "--latency-ms", "90", "--out", "MINE"], "is there already; allowed: a new file"),
    ],
)
def test_it_refuses_in_one_line_before_it_works(words, says, mine, capsys):
    assert command.main([str(mine) if word == "MINE" else word for word in words]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["ames"], "--latency-ms"),
        (["ames", "--latency-ms", "900"], "allowed: 0 to 400"),
        (["ames", "--latency-ms", "90", "--phase-margin", "95"], "allowed: 15 to 75"),
        (["ames", "--latency-ms", "90", "--gain-margin", "1"], "allowed: 2 to 20"),
    ],
)
def test_options_out_of_range_are_named(words, says, capsys):
    with pytest.raises(SystemExit) as caught:
        command.main(words)
    assert caught.value.code == 2
    assert says in capsys.readouterr().err
