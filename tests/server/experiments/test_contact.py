"""`experiments contact`: pressing holds the predicted force, and what is said has a shape."""

from __future__ import annotations

import argparse
import json
from math import isnan
from pathlib import Path

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.obstacle import Socket
from server.experiments import main
from server.experiments.contact import command, free, picture
from server.experiments.contact.flight import ContactTrace, fly
from server.experiments.contact.free import Free
from server.experiments.contact.measure import gaps, row_of, settling, smooth, table_of, touching
from server.experiments.contact.setting import (
    BAND_N,
    GO_S,
    STAY_S,
    ContactScene,
    Way,
    predicted_n,
    spring_n_m,
)
from server.experiments.paper.setup import flight as paper_flight
from server.simulation.sensors import phone

AMES = load_robot("ames")
WALL = ContactScene("wall", 0.02, 0.05)
SOCKET = ContactScene("socket", 0.02, 0.03, Socket())
SOFT = Way("compliant 3 N", 3.0)
TIMES = np.arange(0.005, 20.0, 0.005)


def trace_of(force_n: np.ndarray, ended: str = "") -> ContactTrace:
    touches = force_n > 0.0
    depth = np.where(touches, 0.0, -0.02)
    return ContactTrace(TIMES, force_n, force_n, np.repeat(touches, 5), depth, 0.0 * depth, ended)


def pressed(force_n: float) -> np.ndarray:
    return np.where((TIMES > 1.0) & (TIMES < GO_S + STAY_S + 1.0), force_n, 0.0)


def test_a_steady_force_is_in_the_band_and_never_lost() -> None:
    one = touching(trace_of(pressed(2.4)), 2.5)
    assert one.mean_n == pytest.approx(2.4)
    assert one.in_band_pct == 100.0
    assert one.settling_s < 0.1
    assert (one.bounces, one.lost, one.out) == (0, 0, 1.0)
    assert one.overshoot_pct == pytest.approx(-4.0)


def test_contact_lost_and_regained_is_counted_when_it_happens() -> None:
    force = pressed(2.5)
    force[(TIMES > 1.2) & (TIMES < 1.25)] = 0.0
    for after in (1400, 1600):
        force[after : after + 4] = 0.0
    one = touching(trace_of(force), 2.5)
    assert (one.bounces, one.lost) == (1, 2)


def test_a_contact_that_begins_or_ends_is_no_gap() -> None:
    pushes = np.repeat([False, True, True, False, False, True, False], 8)
    assert gaps(np.ones(56, dtype=bool), pushes) == 1
    assert gaps(np.ones(32, dtype=bool), pushes[:32]) == 0


def test_rattling_of_a_few_milliseconds_is_no_lost_contact() -> None:
    assert gaps(np.ones(90, dtype=bool), np.arange(90) % 10 < 3) == 0


def test_what_never_settles_says_so() -> None:
    assert isnan(settling(np.arange(1000) % 100 < 90))
    assert settling(np.arange(1000) >= 300) == pytest.approx(1.5)


def test_the_table_has_a_line_for_each_and_says_what_ended() -> None:
    good = row_of(WALL, SOFT, 2.5, [trace_of(pressed(2.4))])
    bad = row_of(SOCKET, SOFT, 1.2, [trace_of(pressed(2.4), "+3 s: lost")])
    title, first, second = table_of([good, bad]).splitlines()
    assert "predicted N" in title
    assert "in band %" in title
    assert first.split()[:6] == ["wall", "compliant", "3", "N", "2.50", "2.40"]
    assert second.endswith("ended at +3 s: lost")
    assert "–" in second


def test_the_goal_is_missed_if_contact_is_lost_or_the_plug_stays_out() -> None:
    wall = row_of(WALL, SOFT, 2.5, [trace_of(pressed(2.4))])
    flown = [Free("moving", "stiff", 5.0, ""), Free("moving", SOFT.name, 5.0, "")]
    assert all(command.goals([wall], flown).values())
    outside = row_of(SOCKET, SOFT, 2.5, [trace_of(pressed(2.4))])
    assert not all(command.goals([wall, outside], flown).values())
    slow = [flown[0], Free("moving", SOFT.name, 6.0, "")]
    assert not all(command.goals([wall], slow).values())


def test_the_law_predicts_the_limit_less_the_suspensions_part() -> None:
    assert spring_n_m(AMES.plant) == pytest.approx(26.4, abs=0.05)
    assert predicted_n(3.0, WALL, AMES.plant) == pytest.approx(3.0 - 26.4 * 0.02, abs=0.01)
    assert spring_n_m(load_robot("ground").plant) == 0.0


def test_limits_that_do_not_reach_the_obstacle_are_refused() -> None:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    with pytest.raises(ValueError, match="--limit-n: none reaches the socket"):
        command.flown_of(parser.parse_args(["--limit-n", "1.5"]), AMES)
    names = [(s.name, w.name) for s, w in command.flown_of(parser.parse_args([]), AMES)]
    assert names[:3] == [("wall", w) for w in ("stiff", "compliant 1.5 N", "compliant 3 N")]


def test_the_picture_has_both_scenes(tmp_path: Path) -> None:
    shown = [(row_of(s, SOFT, 2.5, [t]), t) for s in (WALL, SOCKET) for t in [trace_of(pressed(2))]]
    assert picture.draw(shown, tmp_path / "contact.png").stat().st_size > 10_000


def test_a_compliant_push_is_held_without_a_bounce() -> None:
    limit = 1.5
    trace = fly(AMES, phone(), WALL, Way("compliant 1.5 N", limit), 1, 6.0)
    assert trace.ended == ""
    pressing = trace.t > GO_S
    predicted = predicted_n(limit, WALL, AMES.plant)
    assert trace.force_n[pressing].mean() == pytest.approx(predicted, abs=BAND_N)
    assert np.abs(smooth(trace.force_n)[pressing] - predicted).max() < BAND_N
    assert gaps(np.repeat(pressing, 5), trace.pushes) == 0


@pytest.mark.long
@pytest.mark.slow
def test_pressing_with_3_n_keeps_contact_and_the_plug_goes_in_and_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(free, "SECONDS", 1.0)  # of those nothing but their end is asked here
    monkeypatch.setattr(paper_flight, "HOVER_S", 2.5)
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    words = ["--seeds", "1", "--limit-n", "3", "--out", str(tmp_path)]
    assert command.run(parser.parse_args(words)) in (0, 1)
    figures = json.loads((tmp_path / "contact.json").read_text())
    stiff, soft, _, plug = figures["rows"]
    assert soft["lost"] == 0
    assert soft["in_band_pct"] >= command.IN_BAND_PCT > stiff["in_band_pct"]
    assert soft["overshoot_pct"] < 30.0 < stiff["overshoot_pct"]
    assert (plug["plugged"], plug["out"]) == ("1/1", "1/1")
    assert [one["ended"] for one in figures["free"]] == 4 * [""]
    assert (tmp_path / "contact.png").is_file()


def test_a_robot_without_the_papers_gains_is_refused_in_one_line(capsys):
    assert main(["contact", "--robot", "quadrotor"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
