"""`experiments gaps`: what lines do in a gap, how a log becomes figures, and that it flies."""

from __future__ import annotations

import json
from dataclasses import fields
from math import isnan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.robot_file import load_robot
from pipeline.config import VirtualCameraConfig
from pipeline.signals import Mode
from server.control.process import teleop_config
from server.experiments import main
from server.experiments.gaps.flight import Case, FlightLog, fly, released
from server.experiments.gaps.goals import goals, waits_longer_pct
from server.experiments.gaps.measure import FlightFigures, flight_of, row_of, spans
from server.experiments.gaps.schedule import GapSchedule, WebRtcLine, WebSocketLine, heard_again
from server.experiments.gaps.traces import MINUTE_S, Minute, minutes
from server.experiments.gaps.vanish import Vanished
from server.simulation.line import Kind

GAPS = st.builds(GapSchedule, st.floats(0.01, 0.9), st.floats(2.0, 10.0), st.floats(0.0, 5.0))
TIMES = st.lists(st.floats(0.0, 40.0), min_size=2, max_size=60).map(sorted)
KINDS: tuple[Kind, ...] = ("motion", "picture", "touch", "ping", "pong")


@given(GAPS, TIMES)
def test_by_webrtc_what_is_sent_in_a_gap_is_lost_and_all_else_comes_at_once(
    gaps: GapSchedule, times: list[float]
) -> None:
    for t in times:
        assert WebRtcLine(gaps).out(t, "motion") == (None if gaps.dark(t) else t)
        if gaps.dark(t):
            assert WebRtcLine(gaps).out(t, "picture") is None


@given(GAPS, TIMES, st.sampled_from(KINDS))
def test_by_websocket_nothing_is_lost_and_the_order_is_kept(
    gaps: GapSchedule, times: list[float], kind: Kind
) -> None:
    line = WebSocketLine(gaps)
    came = [line.out(t, kind) for t in times]
    assert all(out is not None and out >= t for out, t in zip(came, times, strict=True))
    assert came == sorted(came)
    assert not any(gaps.dark(out) for out in came if out is not None)


@given(st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_tcp_is_heard_after_the_gap_and_no_sooner_after_a_longer_one(
    one: float, more: float
) -> None:
    assert heard_again(0.0, one) >= one
    assert heard_again(0.0, one + more) >= heard_again(0.0, one)
    assert heard_again(0.0, one) - one <= one + 0.3  # it waits twice as long each time


@pytest.mark.parametrize("minute", minutes(), ids=lambda minute: minute.name)
@pytest.mark.parametrize("kind", ["motion", "ping"])
def test_a_recorded_radio_loses_nothing_and_keeps_the_order(minute: Minute, kind: Kind) -> None:
    line = minute.line(begin_s=1.0)
    times = np.arange(0.0, 2.5 * MINUTE_S, 0.004).tolist()
    came = [line.out(t, kind) for t in times]
    assert all(out is not None for out in came)
    late = np.array(came, dtype=float) - times
    assert late.min() == 0.0
    assert late[: round(1.0 / 0.004)].max() == 0.0
    segments = minute.down if kind == "ping" else minute.up
    assert late.max() == pytest.approx(max(out - begin for begin, _, out in segments), abs=0.005)
    assert (np.diff(np.array(came, dtype=float)) >= -1e-9).all()


@pytest.mark.parametrize("minute", minutes(), ids=lambda minute: minute.name)
def test_a_recorded_minute_is_of_gaps_and_not_of_a_phone_that_vanished(minute: Minute) -> None:
    assert minute.longest_s < 1.0
    for segments in (minute.up, minute.down):
        ends = [until for _, until, _ in segments]
        assert all(begin < until <= out <= MINUTE_S for begin, until, out in segments)
        assert all(end <= begin for end, (begin, _, _) in zip(ends, segments[1:], strict=False))


def test_there_are_typical_minutes_of_both_kinds() -> None:
    typical = [minute.kind for minute in minutes() if minute.is_typical]
    assert typical.count("cellular") >= 2
    assert typical.count("wifi") >= 2


def test_a_release_is_never_faster_than_allowed_and_ends() -> None:
    behind, lefts = np.array([0.3, 0.0, 0.0]), []
    for _ in range(600):
        behind = released(behind, 0.005)
        lefts.append(float(np.linalg.norm(behind)))
    assert max(-np.diff([0.3, *lefts])) <= 0.25 * 0.005 + 1e-12
    assert lefts[-1] < 1e-3


def log_of(
    modes: list[Mode], body_y: list[float], reference_y: list[float] | None = None
) -> FlightLog:
    def places(ys: list[float]) -> list[np.ndarray]:
        return [np.array([0.0, y, 0.0]) for y in ys]

    zeros = [0.0] * len(modes)
    return FlightLog(
        t=(0.005 * np.arange(len(modes))).tolist(),
        mode=modes,
        body_in_f=places(body_y),
        ideal_in_f=places(zeros),
        due_in_f=places(zeros),
        reference_in_f=places(reference_y or zeros),
        thrust_n=zeros,
    )


def test_a_gap_that_ends_by_itself_is_no_ended_flight() -> None:
    modes = [Mode.TRACK] * 50 + [Mode.COAST] * 20 + [Mode.TRACK] * 130
    flight = flight_of(log_of(modes, [0.0] * 60 + [0.012] * 140))
    assert (flight.coasts, flight.resumed, flight.ended, flight.holds) == (1, 1, 0, 0)
    assert flight.follows_pct == pytest.approx(90.0)
    assert flight.excursion_mm == pytest.approx(12.0)
    assert flight.drift_mm == pytest.approx(12.0)
    assert flight.step_mm == pytest.approx(12.0)  # the reference has stayed behind


def test_a_flight_that_ramps_is_counted_once_and_how_it_falls_is_no_excursion() -> None:
    modes = [Mode.TRACK] * 50 + [Mode.HOLD] * 20 + [Mode.RAMP] * 20 + [Mode.DISARMED] * 10
    flight = flight_of(log_of(modes, [0.0] * 70 + [0.5] * 30))
    assert (flight.ended, flight.ramps, flight.holds, flight.resumed) == (1, 1, 1, 0)
    assert flight.excursion_mm == 0.0


def test_the_speed_of_a_release_is_that_of_the_reference_beyond_the_ideal() -> None:
    modes = [Mode.TRACK] * 50 + [Mode.COAST] * 20 + [Mode.TRACK] * 230
    ramp = np.clip(0.2 * 0.005 * (np.arange(300) - 70), 0.0, 0.1)
    flight = flight_of(log_of(modes, [0.0] * 300, ramp.tolist()))
    assert flight.release_m_s == pytest.approx(0.2)
    assert flight.quiet_m_s == 0.0


def test_a_reference_that_moved_while_the_robot_coasted_is_seen() -> None:
    modes = [Mode.TRACK] * 50 + [Mode.COAST] * 20 + [Mode.TRACK] * 30
    moved = [0.0] * 70 + [0.02] * 30
    assert flight_of(log_of(modes, [0.0] * 100, moved)).step_mm == pytest.approx(20.0)
    assert flight_of(log_of(modes, moved, moved)).step_mm == 0.0


def test_runs_are_found_at_both_ends_and_in_between() -> None:
    flags = np.array([True, True, False, True, False, True])
    assert spans(flags) == [(0, 2), (3, 4), (5, 6)]
    assert spans(np.zeros(3, dtype=np.bool_)) == []


def flown(**figures: float) -> FlightFigures:
    usual = dict.fromkeys((one.name for one in fields(FlightFigures)), 0.0) | {
        "follows_pct": 99.0,
        "reasons": (),
    }
    return FlightFigures(**(usual | figures))


def test_goals_are_met_or_missed_by_the_figures_and_silent_about_what_was_not_flown() -> None:
    case = Case("phone", "webrtc", 0.25, 5.0)
    assert all(goals([row_of(case, [flown()])], []).values())
    assert goals([], []) == {}
    for spoilt in (
        {"follows_pct": 80.0},
        {"ended": 1},
        {"excursion_mm": 51.0},
        {"release_m_s": 0.3},
        {"step_mm": 2.0},
    ):
        assert not all(goals([row_of(case, [flown(), flown(**spoilt)])], []).values())


def test_a_phone_that_vanished_late_once_in_a_thousand_is_a_miss() -> None:
    fine = [Vanished(0.16, 1.05)] * 999
    assert all(goals([], fine).values())
    assert not all(goals([], [*fine, Vanished(0.16, float("inf"))]).values())
    assert not all(goals([], [*fine, Vanished(0.5, 1.05)]).values())


def test_a_websocket_is_asked_less_by_what_tcp_waits_longer() -> None:
    assert waits_longer_pct(160.0, 5.0) == pytest.approx(0.4)
    assert 1.0 < waits_longer_pct(250.0, 5.0) < 12.0
    row = row_of(Case("phone", "radio", minute="somewhere"), [flown()])
    assert isnan(row.gap_ms)


@pytest.mark.slow
def test_it_flies_writes_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["gaps", "--gap-ms", "300", "--every-s", "5", "--seconds", "5", "--seeds", "1"]
    words += ["--no-traces", "--vanish", "2", "--workers", "1", "--out", str(tmp_path)]
    code = main(words)
    told = json.loads((tmp_path / "gaps.json").read_text())
    assert code == (0 if all(told["holds"].values()) else 1)
    assert [row["way"] for row in told["rows"]] == ["webrtc", "websocket"]
    assert all(row["resumed"] == row["coasts"] >= 1 for row in told["rows"])
    assert all(row["ended"] == row["holds"] == 0 for row in told["rows"])
    assert all(80.0 < row["follows_pct"] < 98.0 for row in told["rows"])
    assert all(one["coast_s"] < 0.2 < 0.9 < one["ramp_s"] < 1.1 for one in told["vanished"])
    assert (tmp_path / "gaps.png").stat().st_size > 10_000
    assert "vanished phone: COAST" in capsys.readouterr().out


def test_a_robot_that_hangs_stays_where_it_is_through_a_gap_of_tcp() -> None:
    """By its suspension, which knows its speed: 142 mm, by its accelerometer alone."""
    ames = load_robot("ames")
    config = teleop_config(ames, "phone", VirtualCameraConfig())
    case = Case("phone", "websocket", 0.25, 5.0)
    flight = flight_of(fly(ames, config, case, seed=2, seconds=8.0))
    assert flight.resumed >= 1
    assert flight.drift_mm < 40.0


def test_after_a_gap_of_webrtc_the_robot_is_not_sent_after_what_a_picture_mends() -> None:
    """0.245 m/s where it follows again without the first one since."""
    ames = load_robot("ames")
    config = teleop_config(ames, "phone", VirtualCameraConfig())
    flight = flight_of(fly(ames, config, Case("phone", "webrtc", 0.16, 5.0), seed=2, seconds=8.0))
    assert flight.resumed >= 1
    assert flight.release_m_s < 0.15
