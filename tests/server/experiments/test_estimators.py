"""`lightleash experiments estimators`: simulated and recorded, as a table, a picture and JSON."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware.sim.world.metrics import judge
from hardware.sim.world.sensors import events
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.signals import BodyImu, PhoneImu, VisionMeasurement
from server.common.text import table
from server.experiments import main
from server.experiments.estimators import command
from server.experiments.estimators import recording as recorded

DATA = Path(__file__).parents[2] / "data"


@pytest.mark.slow
def test_simulated_all_three_are_measured_against_the_bound(tmp_path, capsys):
    words = ["estimators", "--seeds", "1", "--seconds", "3", "--fps", "20", "--out", str(tmp_path)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "1 × 3 s, 20 pictures/s, 60-120 ms late" in said
    rows = {row["name"]: row for row in json.loads((tmp_path / "estimators.json").read_text())}
    assert list(rows) == ["relative", "paper", "none", "bound"]
    assert rows["bound"]["now_mm"] < rows["relative"]["now_mm"] < rows["none"]["now_mm"]
    assert rows["none"]["now_ratio"] > 4.0
    assert all(row["known_pct"] == 100.0 for name, row in rows.items() if name != "bound")
    assert (tmp_path / "estimators.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_recording_is_played_to_all_three(tmp_path, capsys):
    words = ["estimators", "--recording", str(DATA / "virtual_phone.mcap"), "--out", str(tmp_path)]
    assert main(words) == 0
    rows = {row["name"]: row for row in json.loads((tmp_path / "estimators.json").read_text())}
    assert list(rows) == ["relative", "paper", "none"]
    for name in ("relative", "paper"):
        assert rows[name]["now_mm"] < 20.0
        assert rows[name]["known_pct"] == 100.0
    assert "bound" not in capsys.readouterr().out.splitlines()[-4:]


def test_a_recording_that_is_none_is_refused_in_words(tmp_path, capsys):
    file = tmp_path / "no.mcap"
    file.write_bytes(b"nothing")
    assert main(["estimators", "--recording", str(file)]) == 1
    assert str(file) in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--seeds", "0"], ["--fps", "-1"], ["--seconds", "nan"]])
def test_senseless_options_are_refused(words, capsys):
    with pytest.raises(SystemExit):
        main(["estimators", *words])
    assert words[0] in capsys.readouterr().err


def tape_of(world, period=0.005):
    """A tape as a recording of this world would give it."""
    tape, waiting = recorded.EstimatorInputs(), events(world)
    for now in np.arange(0.1, world.t[-1], period).tolist():
        heard = [sample for arrival, sample in waiting if arrival <= now]
        waiting = waiting[len(heard) :]
        messages = [s for s in heard if isinstance(s, PhoneImu)]
        messages += [s for s in heard if isinstance(s, VisionMeasurement)]
        tape.tap(now, messages, [s for s in heard if isinstance(s, BodyImu)])
    return tape


def test_against_later_pictures_an_honest_filter_is_found_honest():
    """Without truth, the pose that came later does: NEES near 6."""
    world = World(WorldOptions(seed=7, duration=5.0))
    tape = tape_of(world)
    track = recorded._track(tape, command.estimator_of("paper", LEDS_IN_B), 0.0)
    score = judge([track], 2.0)
    assert 2.5 < score.nees < 9.0
    assert score.now_mm < 15.0


def test_a_pose_that_is_not_later_than_the_prediction_judges_nothing():
    world = World(WorldOptions(seed=7, duration=2.0, picture_delay=(0.0, 0.001)))
    tape = tape_of(world)
    track = recorded._track(tape, command.estimator_of("none", LEDS_IN_B), 0.0)
    assert np.isnan(track.now.e).all()


def test_tables_are_aligned():
    row = command.EstimatorRow("x", 1.0, 2.0)
    lines = table((("name", "estimator", "{}"), ("now_mm", "mm", "{:.2f}")), [row, replace(row)])
    assert lines.splitlines() == ["estimator    mm", "        x  1.00", "        x  1.00"]
