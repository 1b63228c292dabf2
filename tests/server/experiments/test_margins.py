"""`lightleash experiments margins`: a row an axis, what arming says, a picture."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hardware.robot_text import with_intervals
from server.experiments import main
from tests.hardware.identified_robots import intervals_of, robot_text


def test_it_prints_every_axis_and_what_arming_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["margins", "--gains", "phone", "--latency-ms", "120"]) == 0
    told = capsys.readouterr().out
    rows = [line.split() for line in told.splitlines() if line.split()[:1] == ["phone"]]
    assert [row[2] for row in rows] == 2 * ["x", "y", "z", "roll", "pitch", "yaw"]
    assert all("unstable" in row for row in rows[6:])
    assert not any("unstable" in row for row in rows[:6])
    assert "arming with phone, relative: yes" in told
    assert "arming with phone, none: Pictures are 120 ms old" in told


def test_it_says_what_is_left_where_the_body_is_not_as_told(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["margins", "--gains", "phone", "--estimator", "relative"]) == 0
    told = capsys.readouterr().out
    rows = [line.split() for line in told.splitlines() if line.split()[:1] == ["phone"]]
    assert all(float(worst) < float(nominal) for worst, nominal in map(_phases, rows))
    robust = {row[2]: row[-1] for row in rows}
    assert [robust[axis] for axis in ("roll", "pitch", "yaw")] == ["yes"] * 3
    assert [robust[axis] for axis in "xyz"] == ["no"] * 3
    assert "at least 30° and 6 dB" in told


def test_it_says_which_bodies_are_meant_and_what_was_changed_since_it_was_identified(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["margins", "ground", "--estimator", "relative"]) == 0
    assert "worst: mass ± 30 %, lag × 0.7-1.5, moments as mass, assumed" in capsys.readouterr().out
    text = robot_text("ground")
    text = with_intervals(text, intervals_of(text, 0.03), "for tests")
    robot = tmp_path / "mine.toml"
    for delay, changed in ((0.01, ""), (0.012, " (not what was identified: thrusters.delay_s)")):
        robot.write_text(text.replace("delay_s = 0.01 ", f"delay_s = {delay} "))
        assert main(["margins", str(robot), "--estimator", "relative"]) == 0
        lag = "× 0.7-1.5 (assumed)" if changed else "× 0.78-1.29 (identified ± 3 %), delay ± 0.3 ms"
        said = f"worst: mass × 0.82-1.18 (identified ± 3 %), lag {lag}{changed}, with and without"
        assert said in capsys.readouterr().out


def _phases(row: list[str]) -> tuple[str, str]:
    return row[-4], row[4]


def test_only_controlled_axes_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["margins", "ground", "--estimator", "paper"]) == 0
    told = capsys.readouterr().out
    axes = [line.split()[2] for line in told.splitlines() if line.split()[:1] == ["phone"]]
    assert axes == ["x", "y", "yaw"]


def test_an_unknown_gain_set_is_refused_with_those_there_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["margins", "--gains", "sport"]) == 1
    assert "paper_with_ekf" in capsys.readouterr().out


@pytest.mark.slow
def test_it_draws_and_writes_the_figures(tmp_path: Path) -> None:
    arguments = ["margins", "ground", "--gains", "phone", "--out", str(tmp_path)]
    assert main(arguments) == 0
    assert (tmp_path / "margins.png").stat().st_size > 10_000
    figures = json.loads((tmp_path / "margins.json").read_text())
    assert [row["axis"] for row in figures["margins"]] == 2 * ["x", "y", "yaw"]
    assert all(row["delay_ms"] > 0.0 for row in figures["margins"] if not row["state"])
    assert all("response" not in row for row in figures["margins"])
    assert figures["arming"][0] == "arming with phone, relative: yes"


def test_of_one_that_keeps_its_attitude_by_itself_no_loop_of_ours_turns_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["margins", "copter", "--estimator", "relative"]) == 0
    told = capsys.readouterr().out
    rows = [line.split() for line in told.splitlines() if line.split()[:1] == ["phone"]]
    assert [row[2] for row in rows] == ["x", "y", "z", "yaw"]
    assert [row[-1] for row in rows] == ["yes"] * 4
