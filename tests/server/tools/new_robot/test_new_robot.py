"""`lightleash robot new`: a first file, by options or questions, says what nobody measured."""

from __future__ import annotations

import io
import json
import tomllib
from pathlib import Path

import pytest

from hardware.robot_file import COMMANDS, load_robot
from server.tools.new_robot.questions import KINDS
from server.tools.robot import main


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def new(folder: Path, *options: str) -> tuple[int, Path]:
    file = folder / "mine.toml"
    return main(["new", str(file), "--state", str(folder), *options]), file


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_of_each_kind_of_which_nobody_knows_a_number_passes_the_check(
    kind, tmp_path, capsys
):
    code, file = new(tmp_path, "--kind", kind)
    said = capsys.readouterr().out
    assert code == 0
    assert load_robot(file, takes=COMMANDS).robot.name == "mine"
    for question in KINDS[kind].questions:
        assert f"still to be measured: {question.key}" in said
    text = file.read_text()
    assert text.count("robot new: not measured") == len(KINDS[kind].questions)
    assert main(["check", str(file), "--state", str(tmp_path)]) == 0


@pytest.mark.slow
def test_what_is_said_stands_in_the_file_and_the_rest_follows_from_it(tmp_path, capsys):
    code, file = new(tmp_path, "--kind", "hangs", "--name", "big-one", "--body.mass_kg", "7.0")
    assert code == 0
    table, said = tomllib.loads(file.read_text()), capsys.readouterr().out
    assert table["name"] == "big-one"
    assert table["body"]["mass_kg"] == 7.0
    assert "mass_kg = 7.0  # given to robot new" in file.read_text()
    assert "body.mass_kg" not in said
    ames = load_robot("ames")
    assert table["gains"]["phone"]["Kp"][0] == pytest.approx(2.0 * ames.gains["phone"].Kp[0])
    assert table["thrusters"]["f_max_n"] > 1.4 * ames.robot.f_max
    assert main(["check", str(file), "--state", str(tmp_path), "--json"]) == 0
    assert all(one["ok"] for one in json.loads(capsys.readouterr().out))


@pytest.mark.slow
def test_at_a_terminal_each_question_is_asked_and_a_word_is_asked_again(
    tmp_path, monkeypatch, capsys
):
    count = len(KINDS["hangs"].questions)
    lines = ["swims", "hangs", "heavy", "4.2", *[""] * (count - 1)]
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(lines) + "\n"))
    code, file = new(tmp_path)
    said = capsys.readouterr().out
    assert code == 0
    assert "allowed: hangs, flies, attitude, stands, twist" in said
    assert "allowed: 1 number, or nothing" in said
    assert load_robot(file).plant.mass == 4.2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "--kind: missing; allowed: hangs, flies, attitude, stands, twist"),
        (("--kind", "hangs", "--name", "Ä"), "up to 32 of a-z"),
        (("--kind", "hangs", "--body.mass_kg", "0.001"), "body.mass_kg"),
        (("--kind", "hangs", "--suspension.length_m", "0"), "suspension.length_m"),
        (("--kind", "flies", "--thrusters.f_max_n", "1.0"), "thrusters.f_max_n"),
    ],
)
def test_what_can_t_be_is_refused_by_name_and_nothing_is_written(options, words, tmp_path, capsys):
    code, file = new(tmp_path, *options)
    assert code == 2
    told = capsys.readouterr().err
    assert told.startswith("lightleash robot new: ")
    assert words in told
    assert not file.exists()


def test_no_file_is_overwritten(tmp_path, capsys):
    (tmp_path / "mine.toml").write_text("name = 'old'")
    code, file = new(tmp_path, "--kind", "hangs")
    assert code == 2
    assert file.read_text() == "name = 'old'"


@pytest.mark.parametrize("said", ["", "hangs\n4.2\n"])
def test_an_input_that_ends_amid_the_questions_is_told_in_a_line(
    said, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("sys.stdin", Terminal(said))
    code, file = new(tmp_path)
    assert code == 2
    told = capsys.readouterr().err.strip()
    assert told.startswith("lightleash robot new: the input ended")
    assert "\n" not in told
    assert not file.exists()
