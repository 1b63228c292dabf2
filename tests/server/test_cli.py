"""The command: one word, quick help, clear refusals."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import pytest

import server
from server import cli
from tests.server.export.recordings import FLIGHT


def test_help_names_every_command(capsys):
    for words in ([], ["--help"], ["-h"], ["help"]):
        assert cli.main(words) == 0
        said = capsys.readouterr().out
        assert [name for name in cli.COMMANDS if name not in said] == ["_server"]


def test_an_unknown_word_is_answered_with_those_there_are(capsys):
    assert cli.main(["fly"]) == 2
    said = capsys.readouterr().err
    assert "'fly'" in said
    assert [name for name in cli.COMMANDS if name not in said] == ["_server"]


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert server.__version__ in capsys.readouterr().out


def test_help_loads_nothing_heavy():
    code = "import sys; from server.cli import main; main(['--help']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"numpy", "cv2", "av", "viser", "starlette", "pydantic", "mujoco", "asyncio"}
    assert not heavy & set(done.stdout.split())


@pytest.mark.parametrize(
    ("name", "module"),
    [
        ("phone", "server.virtual_phone.command"),
        ("replay", "server.replay.command"),
        ("experiments", "server.experiments"),
        ("doctor", "server.tools.doctor"),
    ],
)
def test_each_command_gets_its_own_words(name, module, monkeypatch):
    heard = []
    stub = SimpleNamespace(main=lambda words: heard.append(words) or 7)
    monkeypatch.setitem(sys.modules, module, stub)
    assert cli.main([name, "--seconds", "3"]) == 7
    assert heard == [["--seconds", "3"]]


@pytest.mark.parametrize(
    "words",
    [
        ["phone", "--fps", "500"],
        ["replay"],
        ["export", "flight.mcap"],
        ["export", "flight.mcap", "--out", ".", "--to", "film"],
        ["export", "flight.mcap", "--out", ".", "--discard", "all"],
        ["import", "film.mp4"],
        ["import", "film.mp4", "--out", "a.mcap", "--fps", "0"],
        ["import", "film.mp4", "--out", "a.mcap", "--offset", "nan"],
        ["replay", "flight.mcap", "--speed", "0"],
        ["locate"],
        ["locate", ".", "--camera", "a", "--robot", "ames", "--out", "a", "--fps", "often"],
        ["experiments", "fly"],
        ["experiments", "tremor", "--cutoff-hz", "9"],
        ["experiments", "loop", "--seconds", "0"],
        ["experiments", "loop", "--fps", "0"],
        ["experiments", "loop", "--seed", "-1"],
        ["experiments", "margins", "--latency-ms", "-1"],
        ["experiments", "estimators", "--latency-ms", "60", "nan"],
        ["experiments", "estimators", "--seconds", "inf"],
        ["experiments", "plants", "--seed", "-1"],
        ["bench"],
        ["bench", "vision", "--frames", "many"],
        ["calibrate"],
        ["calibrate", "film.mp4", "--store"],
        ["calibrate", "--model", "pinhole"],
        ["calibrate", "film.mp4", "--fps", "-1"],
        ["calibrate", "film.mp4", "--report", "report.txt"],
        ["robot"],
        ["robot", "bring-up", "ames", "--port", "0"],
        ["robot", "onboard", "quadrotor", "--at", "x", "--key", "x", "--port", "70000"],
        ["survey"],
        ["doctor", "--seconds", "few"],
        ["doctor", "--seconds", "0"],
        ["doctor", "--seconds", "nan"],
    ],
    ids=" ".join,
)
def test_a_wrong_command_line_is_told_in_a_line(words, capsys):
    with pytest.raises(SystemExit) as ending:
        cli.main(words)
    assert ending.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith(f"lightleash {words[0]}")
    assert told.endswith("(--help tells more)\n")
    assert told.count("\n") == 1


def test_a_command_ended_by_hand_says_so_with_its_code(monkeypatch):
    def interrupted(words):
        raise KeyboardInterrupt

    monkeypatch.setitem(cli.COMMANDS, "doctor", interrupted)
    assert cli.main(["doctor"]) == 130


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--config"], "a TOML file must follow"),
        (["--config", "/nowhere.toml"], "/nowhere.toml"),
        (["--config=/nowhere.toml"], "/nowhere.toml"),
        (["--config="], "a TOML file must follow"),
        (["--https-port", "70000"], "65535"),
        (["--robot", "nobody"], "no such robot"),
        (["--gains", "none"], "paper_with_ekf"),
    ],
)
def test_serve_refuses_in_one_line_before_anything_starts(
    words, said, capsys, monkeypatch, tmp_path
):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    ports = ["--http-port", "0"] + (["--https-port", "0"] if "--https-port" not in words else [])
    assert cli.main(["serve", *ports, *words]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


@pytest.mark.parametrize("words", [["invite"], ["replay", str(FLIGHT)]], ids=["invite", "replay"])
def test_without_a_server_only_options_that_there_are_are_named(
    words, capsys, monkeypatch, tmp_path
):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert cli.main(words) == 1
    told = capsys.readouterr().err
    assert "no server is running here: start `lightleash serve`" in told
    assert ("--url" in told) == (words[0] == "replay")


@pytest.mark.parametrize(
    "words",
    [
        ["tune", "ames", "--latency-ms", "90"],
        ["robot", "identify", str(FLIGHT)],
        ["robot", "bring-up", "ames"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_file_that_has_no_folder_is_refused_before_the_work(words, capsys, tmp_path):
    assert cli.main([*words, "--out", str(tmp_path / "none" / "x.toml")]) == 2
    told = capsys.readouterr()
    assert told.err.endswith(f"--out: there is no folder {tmp_path / 'none'}\n")
    assert told.err.count("\n") == 1
    assert told.out == ""
