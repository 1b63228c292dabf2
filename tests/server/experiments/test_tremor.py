"""`experiments tremor`: the measure measures, and the virtual camera does what is said of it."""

from __future__ import annotations

import json
from math import radians
from pathlib import Path

import numpy as np
import pytest

from pipeline.config import PERIOD_S
from pipeline.frames import exp
from server.cli import main
from server.experiments.tremor.command import cameras, judge, through
from server.experiments.tremor.hand import attitudes_of_hand

RECORDING = Path(__file__).parents[2] / "data/virtual_phone.mcap"
P_REF = np.array([2.5, 0.0, 0.0])
SHAKEN_HZ, SHAKEN_DEG = 8.0, 0.05
ABOUT, ACROSS = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8])


def shaken(axis: np.ndarray) -> np.ndarray:
    angle = (
        radians(SHAKEN_DEG)
        * np.sqrt(2.0)
        * np.sin(2.0 * np.pi * SHAKEN_HZ * PERIOD_S * np.arange(4000))
    )
    return np.array([exp(a * axis) for a in angle])


def test_a_sine_is_measured_as_large_as_it_is() -> None:
    figures, _ = judge("", shaken(ACROSS), P_REF)
    w, arm = 2.0 * np.pi * SHAKEN_HZ, 2500.0 * radians(SHAKEN_DEG)
    assert figures.across_deg == pytest.approx(SHAKEN_DEG, rel=0.02)
    assert figures.about_deg < 0.01 * SHAKEN_DEG
    assert figures.band_mm == pytest.approx(arm, rel=0.02)
    assert figures.band_mm_s == pytest.approx(w * arm, rel=0.02)
    assert figures.band_m_s2 == pytest.approx(1e-3 * w**2 * arm, rel=0.02)
    assert figures.all_mm_s == pytest.approx(w * arm, rel=0.02)
    assert figures.all_m_s2 == pytest.approx(1e-3 * w**2 * arm, rel=0.02)


def test_a_roll_moves_no_reference() -> None:
    figures, _ = judge("", shaken(ABOUT), P_REF)
    assert figures.about_deg == pytest.approx(SHAKEN_DEG, rel=0.02)
    assert figures.all_mm_s < 1e-6


@pytest.mark.parametrize("mode", ["full", "selective"])
def test_tremor_across_the_line_of_sight_is_attenuated_a_hundredfold(mode: str) -> None:
    made, _ = judge(mode, through(cameras(0.28)[mode], shaken(ACROSS), P_REF)[1000:], P_REF)
    assert made.band_mm < 0.01 * 2500.0 * radians(SHAKEN_DEG)


def test_only_selective_lets_tremor_about_the_line_of_sight_pass() -> None:
    def about(name: str) -> float:
        R_fv = through(cameras(0.28)[name], shaken(ABOUT), P_REF)[1000:]
        return judge(name, R_fv, P_REF)[0].about_deg

    assert about("selective at once") == pytest.approx(about("off"), rel=1e-6)
    assert about("selective") > 0.5 * about("off")
    assert about("full") < 0.01 * about("off")


def test_the_phones_attitude_follows_the_hand_through_rounding_and_delay() -> None:
    times, R_fc, R_true = attitudes_of_hand("steady", 6.0, 1)
    assert np.allclose(np.diff(times), PERIOD_S)
    lost = R_true[400].T @ R_fc[400]  # yaw of f is free, and the bias drifts
    errors = [np.linalg.norm(R.T @ made - lost) for made, R in zip(R_fc, R_true, strict=True)]
    assert np.median(errors[400:]) < radians(0.5)


@pytest.mark.slow
def test_it_prints_a_table_and_writes_a_picture(tmp_path, capsys) -> None:
    assert main(["experiments", "tremor", "--seconds", "8", "--out", str(tmp_path)]) == 0
    words = capsys.readouterr().out
    rows = json.loads((tmp_path / "tremor.json").read_text())
    names = ["hand", "off", "full", "selective", "selective at once", "adaptive 2"]
    assert [row["name"] for row in rows] == names
    assert all(f"{row['band_mm']:.4f}" in words for row in rows)
    assert (tmp_path / "tremor.png").read_bytes()[:4] == b"\x89PNG"


def test_a_recording_takes_the_place_of_the_hand(capsys) -> None:
    assert main(["experiments", "tremor", "--recording", str(RECORDING)]) == 0
    words = capsys.readouterr().out
    assert "virtual_phone.mcap" in words
    assert "hand" not in words


@pytest.mark.parametrize("argument", [["--recording", __file__], ["--hand", "nobody"]])
def test_what_can_not_be_used_is_told(argument: list[str], capsys) -> None:
    assert main(["experiments", "tremor", *argument]) == 2
    assert argument[1] in capsys.readouterr().err


@pytest.mark.parametrize(
    "argument", [["--cutoff-hz", "9"], ["--distance-m", "nan"], ["--seconds", "1"]]
)
def test_numbers_out_of_range_are_refused(argument: list[str], capsys) -> None:
    with pytest.raises(SystemExit):
        main(["experiments", "tremor", *argument])
    assert argument[0] in capsys.readouterr().err
