"""`lightleash robot leds`: report, figures, picture, exit code."""

import json
import sys
import tomllib

import numpy as np
import pytest

from server.tools.robot import main

QUICK = ["--views", "10", "--distances", "2.5"]
IDENTITY = [[0.0, 0.2, 0.2], [0.0, -0.2, 0.2], [0.0, -0.2, -0.2], [0.0, 0.2, -0.2], [0.0, 0.0, 0.0]]


def robot(tmp_path, leds):
    rows = "\n".join(f"[[leds]]\nposition_in_body_m = {list(led)}" for led in leds)
    (tmp_path / "r.toml").write_text(rows)
    return str(tmp_path / "r.toml")


@pytest.mark.slow
def test_the_shipped_robot_is_judged_in_words(capsys):
    assert main(["leds", "ames", *QUICK]) == 0
    said = capsys.readouterr().out
    assert "Verdict at 2.50 m: " in said
    assert "Verdict at 2.50 m: bad" not in said
    assert "IN A PLANE" not in said


@pytest.mark.slow
def test_a_symmetric_flat_layout_is_told_and_fails(tmp_path, capsys):
    assert main(["leds", robot(tmp_path, IDENTITY), *QUICK]) == 1
    said = capsys.readouterr().out
    assert "Verdict at 2.50 m: bad" in said
    assert "THE LEDS ARE ALL IN A PLANE" in said
    assert "A WRONG NAMING FITS AS WELL AS THE RIGHT ONE" in said


@pytest.mark.slow
def test_figures_are_json_and_a_picture_is_drawn(tmp_path, capsys):
    assert main(["leds", "quadrotor", *QUICK, "--json", "--out", str(tmp_path / "out")]) == 0
    (figures,) = json.loads(capsys.readouterr().out)
    (row,) = figures["distances"]
    assert row["margin_four_gravity_px"] > row["margin_four_nothing_px"]
    assert 0.0 < row["sigma_lateral_median_m"] < row["sigma_depth_median_m"]
    assert (tmp_path / "out" / "leds.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "out" / "leds.json").read_text()) == [figures]


@pytest.mark.slow
def test_without_matplotlib_figures_are_written_all_the_same(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["leds", "quadrotor", *QUICK, "--out", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["leds.json"]
    told = capsys.readouterr().err
    assert "pip install 'lightleash[plots]'" in told
    assert f"wrote leds.json in {tmp_path}" in told


@pytest.mark.slow
def test_an_improvement_is_toml_to_paste(tmp_path, capsys):
    moves = np.array([[0.02, 0, 0], [0, 0.01, 0], [0, 0, 0], [0, 0, 0.03]])
    given = np.array(IDENTITY[:4]) + moves  # of five a search asks many more namings
    file = robot(tmp_path, given.tolist())
    out = tmp_path / "out"
    words = ["--improve", "--turns", "4", "--starts", "1", "--reach", "0.08", "--out", str(out)]
    assert main(["leds", file, *QUICK, *words]) in (0, 1)
    assert "To paste:" in capsys.readouterr().out
    rows = tomllib.loads((out / "leds_improved.toml").read_text())["leds"]
    places = np.array([row["position_in_body_m"] for row in rows])
    assert np.linalg.norm(places - given, axis=1).max() < 0.0801


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nobody"], "no such robot"),
        (["ames", "--distances", "0.25"], "go farther"),
        (["ames", "--out", __file__], "no folder can be made"),
    ],
)
def test_what_can_not_be_done_is_told_in_a_line(words, told, capsys):
    assert main(["leds", *words]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1


def test_options_out_of_range_are_refused(capsys):
    with pytest.raises(SystemExit):
        main(["leds", "ames", "--views", "3"])
    said = capsys.readouterr().err
    assert "allowed: 10 to 5000" in said
    assert said.count("\n") == 1
