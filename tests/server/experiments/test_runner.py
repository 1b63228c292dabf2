"""What experiments do alike: refusals, exit codes, JSON without NaN, pictures."""

from __future__ import annotations

import json
from argparse import Namespace
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path

import pytest

from hardware.robot_file import load_robot
from server.experiments.runner import ExperimentReport, RefusedError, experiment


@dataclass(frozen=True)
class Row:
    name: str
    far_mm: float


@pytest.mark.parametrize(
    ("found", "code"),
    [
        (ExperimentReport([]), 0),
        (ExperimentReport([], holds={"near": True, "soon": True}), 0),
        (ExperimentReport([], holds={"near": True, "soon": False}), 1),
        (ExperimentReport([], is_good=False), 1),
        (7, 7),
    ],
    ids=str,
)
def test_the_exit_code_says_whether_all_went_well(found: ExperimentReport | int, code: int) -> None:
    assert experiment("some")(lambda arguments: found)(Namespace(out=None)) == code


def test_what_is_asked_wrongly_is_refused_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    def measure(arguments: Namespace) -> ExperimentReport:
        raise arguments.error

    run = experiment("some", OSError)(measure)
    for error in (RefusedError("--far: allowed: 1 to 2"), OSError("no such file")):
        assert run(Namespace(error=error, out=None)) == 2
        assert capsys.readouterr().err == f"lightleash experiments some: {error}\n"
    assert (
        experiment("some")(lambda _: ExperimentReport(load_robot("amse")))(Namespace(out=None)) == 2
    )
    assert "no such robot" in capsys.readouterr().err


def test_our_own_mistakes_are_no_refusals() -> None:
    def measure(arguments: Namespace) -> ExperimentReport:
        raise ValueError("shapes")

    with pytest.raises(ValueError, match="shapes"):
        experiment("some")(measure)(Namespace(out=None))


def test_rows_statements_and_pictures_are_written_where_they_are_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn: list[Path] = []

    def draw(folder: Path) -> list[Path]:
        drawn.append(folder / "some.png")
        return drawn

    found = ExperimentReport(
        {"rows": (Row("a", nan), Row("b", 2.0)), "most": [inf]},
        "a table",
        {"near": False},
        draw=draw,
    )
    run = experiment("some")(lambda arguments: found)
    assert run(Namespace(out=None)) == 1
    assert capsys.readouterr().out == "a table\n\nMISSED: near\n"
    assert not drawn
    run(Namespace(out=tmp_path / "new" / "folder"))
    file = tmp_path / "new" / "folder" / "some.json"
    assert json.loads(file.read_text()) == {
        "rows": [{"name": "a", "far_mm": None}, {"name": "b", "far_mm": 2.0}],
        "most": [None],
        "holds": {"near": False},
    }
    assert capsys.readouterr().out.endswith(f"written: {file}, {drawn[0]}\n")


def test_a_folder_that_can_t_be_made_is_refused_before_the_work_and_a_full_disk_after_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measured: list[bool] = []

    def measure(arguments: Namespace) -> ExperimentReport:
        measured.append(True)
        return ExperimentReport([], "a table")

    run = experiment("some")(measure)
    (tmp_path / "file").write_text("")
    assert run(Namespace(out=tmp_path / "file")) == 2
    assert not measured
    said = capsys.readouterr()
    assert said.err.startswith("lightleash experiments some: --out: ")
    assert said.err.count("\n") == 1
    (tmp_path / "out" / "some.json").mkdir(parents=True)
    assert run(Namespace(out=tmp_path / "out")) == 2
    said = capsys.readouterr()
    assert said.out == "a table\n"
    assert said.err.startswith("lightleash experiments some: --out: ")
    assert said.err.count("\n") == 1
