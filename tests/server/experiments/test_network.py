"""`experiments network`: its figures are what they say, and it says what it needs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.sim.network.channel import Counts
from hardware.sim.network.emulated_link import Lateness
from hardware.sim.network.netns import NamespaceError
from server.experiments import main
from server.experiments.network import command
from server.experiments.network.figures import FRESH_S, Arrivals, drops, percentile, recovery
from server.experiments.network.run import Run, RunError
from server.experiments.network.scenarios import SCENARIOS, LinkGoals

RATE_HZ = 30.0
DELAYS = st.lists(st.floats(0.0, 0.5), min_size=2, max_size=60)


def arrivals(delays: list[float], begin: float = 0.0) -> Arrivals:
    """Pictures at 30 Hz that came so late, in order of arrival."""
    taken = begin + np.arange(len(delays)) / RATE_HZ
    came = taken + np.array(delays)
    order = np.argsort(came, kind="stable")
    return Arrivals(taken[order], came[order])


def run_of(frames: Arrivals, **changes: object) -> Run:
    end = float(frames.taken.max()) + 1.0 / RATE_HZ
    counts = (Counts(), Counts())
    late = Lateness(0.0, 0.0, 0.0)
    plain = Run(0.0, end, frames, frames, frames, [], "WebRTC", 0, 0, "", counts, late)
    return replace(plain, **changes)


@given(DELAYS)
def test_the_newest_is_never_older_than_what_came_and_ages_by_the_clock(delays):
    one = arrivals(delays)
    end = float(one.came.max())
    ages = one.ages_of_newest(float(one.came.min()), end + 0.1)
    assert np.all(ages >= one.ages.min() - 1e-9)
    last = end + 0.1 - one.taken.max()
    assert ages[-1] == pytest.approx(last, abs=2e-3)
    growth = np.diff(ages)
    assert np.all((growth < 0.0) | (np.abs(growth - 1e-3) < 1e-9))


def test_with_one_in_three_lost_the_newest_is_older_in_the_tail_only():
    whole = arrivals([0.01] * 300)
    holes = Arrivals(whole.taken[np.arange(300) % 3 > 0], whole.came[np.arange(300) % 3 > 0])
    old, older = (percentile(one.ages_of_newest(1.0, 9.0), 99.9) for one in (whole, holes))
    assert old == pytest.approx(0.01 + 1 / RATE_HZ, abs=2e-3)
    assert older == pytest.approx(0.01 + 2 / RATE_HZ, abs=2e-3)


@given(st.integers(1, 90))
def test_drops_are_the_pictures_that_never_came_whatever_came_twice(missing):
    whole = arrivals([0.02] * 90)
    end = 90 / RATE_HZ
    kept = np.arange(90) >= missing
    part = Arrivals(np.repeat(whole.taken[kept], 2), np.repeat(whole.came[kept], 2))
    assert drops(part, 0.0, end, RATE_HZ) == pytest.approx(missing / 90)


@given(st.floats(0.0, 2.0), st.integers(0, 30))
def test_recovery_is_when_the_last_stale_picture_is_past(t_over, stale):
    delays = [0.3] * stale + [0.02] * 90
    one = arrivals(delays, begin=t_over)
    came = one.came[(one.ages < FRESH_S)]
    last_stale = one.came[one.ages > FRESH_S].max(initial=-np.inf)
    assert recovery(one, t_over) == pytest.approx(came[came > last_stale].min() - t_over)


def test_what_never_recovers_takes_for_ever():
    assert recovery(arrivals([0.3] * 60), 0.0) == np.inf
    assert recovery(arrivals([0.02] * 10), 5.0) == np.inf


def test_percentiles_of_nothing_and_of_forever():
    assert np.isnan(percentile(np.zeros(0), 50.0))
    assert percentile(np.array([1.0, np.inf]), 99.9) == np.inf
    assert percentile(np.arange(1000.0), 99.9) == 999.0


def test_a_row_judges_the_path_by_webrtc_by_its_goals_alone():
    goals = LinkGoals(frame_p95_ms=100.0, drops_pct=2.0, recovery_s=0.5)
    scenario = replace(SCENARIOS["clean"], goals=goals)
    slow = run_of(arrivals([0.15] * 60), fault_ends=[0.5])
    row = command.row_of(scenario, "webrtc", slow)
    assert row.verdict == "frame_p95_ms > 100, recovery_s > 0.5"
    assert row.frame_p50_ms == pytest.approx(150.0)
    assert command.row_of(scenario, "websocket", slow).verdict == ""
    fine = run_of(arrivals([0.02] * 60), fault_ends=[0.5])
    assert command.row_of(scenario, "webrtc", fine).verdict == "met"
    ended = replace(fine, ended="the server hung up")
    assert command.row_of(scenario, "webrtc", ended).verdict == "the server hung up"


def test_a_table_a_picture_and_json_come_of_it(monkeypatch, tmp_path, capsys):
    def measured(arguments):
        for name in arguments.scenarios:
            for path, late in (("webrtc", 0.02), ("websocket", 0.04)):
                yield SCENARIOS[name], path, run_of(arrivals([late] * 90))

    monkeypatch.setattr(command, "measure", measured)
    assert main(["network", "--scenarios", "clean", "loss1", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert len([line for line in printed.splitlines() if "websocket" in line]) == 2
    told = json.loads((tmp_path / "network.json").read_text())
    assert [row["scenario"] for row in told] == ["clean", "clean", "loss1", "loss1"]
    assert told[2]["verdict"] == "met"
    assert told[0]["recovery_s"] is None
    assert (tmp_path / "network.png").stat().st_size > 10_000


@pytest.mark.parametrize("error", [NamespaceError("takes root"), RunError("the phone is gone")])
def test_where_it_cannot_measure_it_says_why(error, monkeypatch, capsys):
    def measured(_):
        raise error
        yield

    monkeypatch.setattr(command, "measure", measured)
    assert main(["network"]) == 2
    assert str(error) in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments", [["--scenarios", "moon"], ["--seconds", "1"], ["--paths", "pigeon"]]
)
def test_options_are_checked(arguments, capsys):
    with pytest.raises(SystemExit):
        main(["network", *arguments])
    assert arguments[0] in capsys.readouterr().err


def test_help_tells_every_line(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["network", "--help"])
    assert ended.value.code == 0
    told = "".join(capsys.readouterr().out.split())  # lines are broken anywhere
    for one in SCENARIOS.values():
        assert "".join(f"{one.name}: {one.description}".split()) in told
