"""`experiments paper`: the paper's orderings hold when flown, and what is said has a shape."""

from __future__ import annotations

import json
from dataclasses import replace
from math import isnan
from pathlib import Path

import numpy as np
import pytest

from hardware.robot_file import load_robot
from server.cli import main
from server.experiments.paper import comparison, disturbance, picture, table_1, table_4
from server.experiments.paper.setup import assumptions, flight, published
from server.experiments.paper.setup.flight import ExperimentTrace, Move, Push
from server.experiments.paper.setup.measure import WINDOW_S, ExperimentSetup, cell_of
from server.experiments.paper.setup.variants import (
    WITH_EKF,
    WITH_VCI,
    WITHOUT_EKF,
    VariantRequest,
    config_of,
    ours,
)
from server.experiments.runner import ExperimentReport
from server.simulation.sensors import PAPER, phone

AMES = load_robot("ames")
SETUP = ExperimentSetup(AMES, PAPER, (1,))


def trace_of(error_mm: float, t: np.ndarray, ended: str = "") -> ExperimentTrace:
    """Of a controller that errs by so much along x, and truly by half of it."""
    n = len(t)
    error = np.zeros((n, 6))
    error[:, 0] = 1e-3 * error_mm
    thrusts = np.full((n, 8), 0.5)
    return ExperimentTrace(
        t, error, 0.5 * error, np.zeros((n, 3)), thrusts, np.zeros((n, 6)), np.zeros(n),
        np.zeros((n, 3)), ended,
    )  # fmt: skip


TIMES = np.arange(-1.0, 5.0, 0.005)


def test_a_cell_is_the_rms_within_the_window_beside_the_papers() -> None:
    error = trace_of(7.0, TIMES)
    error.error_in_b[TIMES >= WINDOW_S] = 9.9
    error.error_in_b[TIMES < 0.0] = 9.9
    cell = cell_of("without EKF", "x", 7.11, [error, trace_of(5.0, TIMES)])
    assert cell.ours == pytest.approx(6.0)
    assert cell.spread == pytest.approx(1.0)
    assert cell.true == pytest.approx(3.0)
    assert cell.ratio == pytest.approx(6.0 / 7.11)


def test_a_flight_that_ended_gives_no_figures() -> None:
    cell = cell_of("ours", "x", 1.0, [trace_of(1.0, TIMES), trace_of(1.0, TIMES, "+1 s: lost")])
    assert isnan(cell.ours)
    assert isnan(cell.ratio)
    assert cell.ended == "+1 s: lost"


def test_back_is_where_it_last_leaves_a_tenth_of_its_peak() -> None:
    t = np.arange(-1.0, 5.0, 0.01)
    away = np.where(t > 0.0, np.exp(-t), 0.0)
    assert disturbance.back_after(t, away) == pytest.approx(np.log(10.0), abs=0.02)
    assert disturbance.back_after(t, np.zeros_like(t)) == 0.0


def test_flights_that_ended_before_the_move_are_drawn_empty(tmp_path: Path) -> None:
    lost = trace_of(1.0, np.zeros(0), "-5 s: lost")
    rows = (disturbance.rejection("ours", [lost], [lost]),)
    assert "lost" in disturbance.Pushed(rows, lost).text()
    assert disturbance.Pushed(rows, lost).draw(tmp_path)[0].stat().st_size > 5_000
    assert picture.figure_6({"with EKF": lost, "ours": lost}, tmp_path / "6.png").is_file()
    both = {"with VCI": lost, "without VCI": lost}
    assert picture.figure_8(both, 3.0, tmp_path / "8.png").is_file()


def test_the_flight_is_the_papers_move() -> None:
    (trace,) = SETUP.fly(WITH_EKF, "step_x", 0.5)
    assert trace.ended == ""
    assert trace.t[0] == pytest.approx(-1.0, abs=0.006)
    assert trace.t[-1] == pytest.approx(0.5, abs=0.006)
    assert np.abs(trace.moved[trace.t <= 0.0]).max() == 0.0
    assert trace.moved[-1] == pytest.approx([0.03, 0.0, 0.0], abs=1e-9)
    k = int(np.argmax(trace.error_in_b[:, 0]))
    assert trace.error_in_b[k, 0] > 0.01  # the reference runs ahead of the body
    assert trace.wrench_in_b[:, 0].max() > 1.0


def test_the_same_seed_flies_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight, "HOVER_S", 4.0)
    first, second = (SETUP.fly(WITHOUT_EKF, "step_y", 0.1)[0] for _ in range(2))
    assert np.array_equal(first.error_in_b, second.error_in_b)


@pytest.mark.slow
def test_table_1_the_ekf_lowers_every_error_and_its_figures_are_near_the_papers() -> None:
    result = table_1.measure(SETUP)
    assert all(result.holds.values()), result.text()
    assert all(0.75 < cell.ratio < 1.25 for cell in result.cells), result.text()


@pytest.mark.slow
def test_table_4_the_vci_lowers_every_error_and_no_thruster_saturates(tmp_path: Path) -> None:
    result = table_4.measure(SETUP)
    assert all(result.holds.values()), result.text()
    assert all(0.75 < cell.ratio < 1.25 for cell in result.cells if cell.axis == "y")
    pictures = result.draw(tmp_path)
    assert [path.name for path in pictures] == ["fig_7.png", "fig_8.png"]
    assert all(path.stat().st_size > 10_000 for path in pictures)


@pytest.mark.slow
def test_a_push_is_answered_by_as_much_thrust() -> None:
    result = disturbance.measure(SETUP)
    assert result.rows[0].answer_n == pytest.approx(-published.PUSH_N, abs=0.3)
    assert result.rows[0].peak_mm > 20.0
    assert all(result.holds.values()), result.text()


def test_a_push_comes_when_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight, "HOVER_S", 4.0)
    push = Push(0.1, -4.0)
    pushed = SETUP.fly(WITH_VCI, "still", 0.4, push)[0]
    left = SETUP.fly(WITH_VCI, "still", 0.4)[0]
    away = pushed.missed_in_b[:, 1] - left.missed_in_b[:, 1]
    assert np.abs(away[pushed.t < 0.1]).max() < 1e-9
    assert away[-1] > 1e-3  # the body is pushed to −y: short of its reference


def test_each_move_is_flown_by_pictures_too_and_as_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """An encoder's threads are not in a copy of the process: the flight waited for ever."""
    monkeypatch.setattr(flight, "HOVER_S", 2.5)
    setup = ExperimentSetup(AMES, phone(pictures="h264"), (1,))
    (each,) = setup.fly_each(WITH_EKF, [Move("step_x")], 0.3)
    (alone,) = setup.fly(WITH_EKF, "step_x", 0.3)
    assert len(alone.t) > 10
    np.testing.assert_array_equal(each[0].error_in_b, alone.error_in_b)


def test_pictures_of_a_phone_are_as_late_and_as_many_as_asked_for() -> None:
    leader = phone(60.0, (0.18, 0.2))
    assert leader.options.frame_rate_hz == 60.0
    assert leader.options.picture_delay_s == (0.18, 0.2)
    assert leader.options.step_a == 0.1  # the browser's rounding


def test_goals_are_the_papers_better_columns_and_half_of_them() -> None:
    limits = {(g.leader.name, g.table, g.axis): g.limit for g in comparison.goals()}
    assert limits["phone", "I", "x"] == 3.65
    assert limits["paper", "I", "z"] == pytest.approx(2.045)
    assert limits["phone", "IV", "yaw"] == limits["paper", "IV", "yaw"] == 0.21
    assert len(limits) == 10


def test_a_goal_that_is_missed_is_flown_again_in_better_worlds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flight, "HOVER_S", 2.5)
    monkeypatch.setattr(comparison, "SECONDS", 0.5)
    hard = replace(comparison.goals()[1], limit=0.5)
    monkeypatch.setattr(comparison, "goals", lambda pictures: [hard, replace(hard, limit=50.0)])
    missed, reached = comparison.measure(SETUP).rows
    assert missed.reached.startswith("missed by")
    assert missed.no_thruster_lag < missed.true
    assert missed.perfect_sensors < missed.true
    assert missed.twice_the_thrust > 0.0
    assert reached.reached == "reached"
    assert isnan(reached.no_thruster_lag)
    summary = comparison.Summary((missed, reached), phone())
    ExperimentReport(summary.json()).write(tmp_path, "summary")
    said = json.loads((tmp_path / "summary.json").read_text())
    assert said["rows"][1]["no_thruster_lag"] is None


def test_beaten_flies_its_phones_with_the_pictures_asked_for() -> None:
    pictures = {(goal.leader.name, goal.leader.pictures) for goal in comparison.goals("h264")}
    assert pictures == {("phone", "h264"), ("paper", "spots")}


def test_wishes_are_flown() -> None:
    wishes = VariantRequest("none", "paper_without_ekf", "full", 0.28, False)
    config = config_of(AMES, ours(phone(), wishes, "off"), phone())
    assert config.estimator == "none"
    assert config.gains is AMES.gains["paper_without_ekf"]
    assert config.virtual_camera.mode == "full"
    assert config.virtual_camera.tau_1 == pytest.approx(0.525, abs=1e-3)
    assert not config.feedforward.enabled


def test_every_number_says_what_it_rests_on() -> None:
    leaders = (PAPER, phone(), phone(pictures="h264"))
    for setup in (ExperimentSetup(AMES, leader, (1,)) for leader in leaders):
        said = assumptions.json(assumptions.of(setup))
        assert {one["status"] for one in said} == {"known", "identified", "chosen"}
        assert len({one["what"] for one in said}) == len(said)
        assert all(one["value"] for one in said)


def test_it_is_said_whether_there_are_pictures() -> None:
    spots = assumptions.lines(assumptions.phone_sensors(phone()))
    film = assumptions.lines(assumptions.phone_sensors(phone(pictures="vp8")))
    assert "nothing is rendered" in spots
    assert "rendered, vp8 at 3 Mbit/s" in film
    assert "nothing is rendered" not in film


def test_the_command_writes_its_figures_and_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_1, "SECONDS", 0.4)
    monkeypatch.setattr(flight, "HOVER_S", 2.5)
    words = ["experiments", "paper", "--only", "table_1", "--seeds", "1", "--out", str(tmp_path)]
    main(words)
    printed = capsys.readouterr().out
    assert "paper" in printed
    assert "ratio" in printed
    assert "identified" in printed
    told = json.loads((tmp_path / "paper.json").read_text())
    cells = told["table_1"]["cells"]
    assert [(cell["variant"], cell["axis"]) for cell in cells] == [
        (column, axis) for column in ("without EKF", "with EKF") for axis in "xyz"
    ]
    assert cells[0]["paper"] == 7.11
    assert (tmp_path / "fig_6.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--gains", "stiff"], "'stiff' is not one of its sets: phone, paper_with_ekf"),
        (["--robot", "quadrotor"], "is not one of its sets"),
        (["--robot", "amse"], "no such robot"),
        (["--pictures", "h264"], "allowed with --leader paper: spots"),
    ],
)
def test_what_can_not_be_flown_is_said(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experiments", "paper", *words]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["--fps", "nan"],
        ["--latency-ms", "60"],
        ["--seeds", "0"],
        ["--only", "table_9"],
        ["--pictures", "raw"],
    ],
)
def test_options_out_of_range_are_refused(words: list[str]) -> None:
    with pytest.raises(SystemExit):
        main(["experiments", "paper", *words])
