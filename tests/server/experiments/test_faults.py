"""`experiments faults`: what a fault does, how an outcome is judged, and that it flies."""

from __future__ import annotations

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.robot_file import load_robot
from pipeline.config import VirtualCameraConfig
from pipeline.signals import PhoneImu, TouchState
from server.control.ipc_inputs import ReadyInput, is_believable
from server.control.process import teleop_config
from server.experiments import main
from server.experiments.faults import hazards, live, tampering
from server.experiments.faults.catalogue import FAULTS
from server.experiments.faults.command import FaultJob, flown, goals
from server.experiments.faults.fault import FARTHEST_MM, Fault, FaultOutcome, misses
from server.experiments.faults.live import LIVE, FaultStage, LiveFault, LiveOutcome, outcome_of
from server.experiments.faults.measure import live_goals, live_times, row_of, times_of
from server.experiments.forked import ForkError, forked

ROOT = Path(__file__).resolve().parents[3]
DATAGRAMS = st.lists(st.binary(min_size=1, max_size=40), max_size=60)


def outcome(**more: object) -> FaultOutcome:
    usual: dict[str, object] = {
        "fault": "made up",
        "seed": 1,
        "first": {"COAST": 0.15, "RAMP": 1.0, "zero": 3.0},
        "excursion_mm": 10.0,
        "tilt_deg": 5.0,
        "after_zero": 0,
        "follows": False,
        "thrust_n": 0.0,
        "words": "No word from the phone.",
    }
    return FaultOutcome(**(usual | more))


MADE_UP = Fault(
    "made up", "16", lambda world: None, "zero", {"COAST": 0.17, "zero": 4.0}, never=("TRACK",)
)


@pytest.mark.parametrize(
    "spoilt",
    [
        {"first": {"COAST": 0.18, "zero": 3.0}},
        {"first": {"COAST": 0.15}},
        {"first": {"COAST": 0.15, "zero": 3.0, "TRACK": 2.0}},
        {"excursion_mm": 151.0},
        {"tilt_deg": 31.0},
        {"after_zero": 1},
        {"thrust_n": 0.5},
    ],
)
def test_each_bound_is_missed_by_what_breaks_it(spoilt: dict[str, object]) -> None:
    assert misses(MADE_UP, outcome()) == []
    assert len(misses(MADE_UP, outcome(**spoilt))) == 1


def test_a_ramp_in_time_misses_no_hold_and_a_hold_no_ramp() -> None:
    holds = replace(MADE_UP, by={"HOLD": 2.0, "zero": 4.0})
    assert misses(holds, outcome()) == []
    late = misses(holds, outcome(first={"RAMP": 2.1, "zero": 3.0}))
    assert late == ["HOLD 2.100 s > 2"]
    ramps = replace(MADE_UP, by={"RAMP": 2.0, "zero": 4.0})
    assert len(misses(ramps, outcome(first={"HOLD": 1.0, "zero": 3.0}))) == 1


def test_who_is_to_fly_on_must_follow_at_the_end() -> None:
    flies = Fault("made up", "18", lambda world: None, "flies")
    assert misses(flies, outcome(follows=True, thrust_n=3.0, after_zero=7)) == []
    assert "No word from the phone." in misses(flies, outcome())[0]


def test_a_row_is_the_worst_of_its_seeds_and_one_miss_is_a_miss() -> None:
    late = outcome(seed=2, first={"COAST": 0.2, "RAMP": 1.0, "zero": 3.1}, excursion_mm=60.0)
    row = row_of(MADE_UP, [outcome(), late])
    assert (row.COAST, row.zero, row.excursion_mm) == (0.2, 3.1, 60.0)
    assert row.missed == "COAST 0.200 s > 0.17"
    (coast,) = (one for one in times_of([MADE_UP], [outcome(), late]) if one.event == "COAST")
    assert (coast.n, coast.p99_9) == (2, 0.2)
    assert list(goals([row], 2).values()) == [True, False]


class Rig:
    """A robot that does not answer every other time."""

    def __init__(self) -> None:
        self.asked = 0

    def look(self) -> tuple[float, float, FaultStage] | None:
        self.asked += 1
        return (3.0, 0.01, FaultStage.FOLLOWS) if self.asked % 2 else None


@pytest.mark.parametrize(("dies", "least"), [(False, 3.0), (True, 0.0)])
def test_silence_is_no_thrust_only_of_a_robot_that_dies(dies: bool, least: float) -> None:
    thrusts = live._watch(Rig(), 0.05, dies)[:, 1]
    assert len(thrusts) >= 2
    assert thrusts.min() == least


def test_live_faults_have_their_times_and_bounds_by_fault() -> None:
    of_it = "phone", signal.SIGKILL, 3.0
    faults = LiveFault("killed", *of_it, 0.17, 1.1), LiveFault("stopped", *of_it)
    falls, zeros = (0.3, 0.35, 0.31), (2.5, 2.6, 2.9)
    killed = [
        LiveOutcome("killed", coasts, 1.0, falling, zero, 0, 30.0, "")
        for coasts, falling, zero in zip((0.12, 0.18, 0.13), falls, zeros, strict=True)
    ]
    stopped = LiveOutcome("stopped", 0.1, 0.2, 1.0, float("inf"), 0, 30.0, "zero inf s")
    times = live_times(faults, [*killed, stopped])
    rows = {(one.fault, one.event): one for one in times}
    assert (rows["killed", "COAST"].p50, rows["killed", "RAMP"].p99_9) == (0.13, 1.0)
    assert ("stopped", "COAST") not in rows
    assert list(live_goals(faults, times).values()) == [False, True]
    assert (rows["killed", "falls"].n, rows["killed", "falls"].p50) == (3, 0.31)
    assert rows["killed", "zero"].p99_9 == 2.9
    assert rows["stopped", "zero"].p50 == float("inf")


def test_the_catalogue_has_enough_faults_each_with_a_name_of_its_own() -> None:
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names) >= 41
    for fault in FAULTS:
        assert all(limit < fault.watch_s for limit in fault.by.values()), fault.name
        assert not set(fault.by) & set(fault.never), fault.name


@given(DATAGRAMS, st.integers(0, 20))
def test_late_ones_come_in_order_and_none_is_made_up(sent: list[bytes], ticks: int) -> None:
    link = tampering.late(ticks)
    came = [one for data in sent for one in link(data)]
    assert came == sent[: max(0, len(sent) - ticks)]


@given(DATAGRAMS, st.integers(1, 20))
def test_replays_come_beside_what_is_sent(sent: list[bytes], ticks: int) -> None:
    link = tampering.replayed(ticks)
    for k, data in enumerate(sent):
        again = [sent[k - ticks]] if k >= ticks else []
        assert list(link(data)) == [data, *again]


@given(DATAGRAMS, st.integers(0, 100))
def test_a_spoilt_one_differs_by_a_bit(sent: list[bytes], seed: int) -> None:
    link = tampering.spoilt(0.5, seed)
    for data in sent:
        (came,) = link(data)
        differ = [bin(a ^ b).count("1") for a, b in zip(data, came, strict=True)]
        assert sum(differ) <= 1


def test_what_is_no_number_never_reaches_control() -> None:
    sample = PhoneImu(1.0, np.array((0.1, 0.2, 0.3)), np.array((0.0, 0.0, 9.8)))
    assert is_believable(sample)
    for change in (tampering.no_number, tampering.infinite):
        assert not any(map(is_believable, tampering.motion(change)([sample])))


def test_a_touch_that_comes_again_keeps_its_age() -> None:
    repeat = tampering.stale_touch()
    ready = ReadyInput([])
    assert repeat([ready]) == [ready]
    first, second = TouchState(1.0, True, 1), TouchState(2.0, True, 1)
    assert repeat([first]) == [first]
    assert repeat([second, ready]) == [ready, first]


def test_a_copy_of_the_process_answers_and_leaves_nothing_behind() -> None:
    kept = [1]

    def work() -> tuple[int, list[int]]:
        kept.append(2)
        return os.getpid(), kept

    pid, seen = forked(work)
    assert pid != os.getpid()
    assert (seen, kept) == ([1, 2], [1])


def test_a_copy_that_fails_is_an_error_here() -> None:
    def fail() -> None:
        os._exit(3)

    with pytest.raises(ForkError):
        forked(fail)


@pytest.mark.slow
def test_two_faults_are_flown_written_and_drawn(tmp_path: Path) -> None:
    words = ["faults", "--seeds", "1", "--workers", "1", "--out", str(tmp_path)]
    code = main([*words, "--only", "STOP while it", "--vanish", "2"])
    told = json.loads((tmp_path / "faults.json").read_text())
    assert code == 0
    assert all(told["holds"].values())
    assert len(told["rows"]) == 4
    assert all(row["zero"] < 0.25 and row["after_zero"] == 0 for row in told["rows"])
    at_any_moment = [one for one in told["times"] if one["fault"].startswith("phone vanishes")]
    assert [(one["event"], one["n"]) for one in at_any_moment] == [("COAST", 2), ("RAMP", 2)]
    assert all(one["p50"] <= one["p99"] <= one["p99_9"] for one in told["times"])
    assert np.isfinite([row["excursion_mm"] for row in told["rows"]]).all()
    assert (tmp_path / "faults.png").stat().st_size > 5_000


@pytest.mark.slow
def test_a_zoom_in_flight_is_held_as_if_there_were_no_pictures() -> None:
    robot_file = load_robot("ames")
    config = teleop_config(robot_file, "phone", VirtualCameraConfig(), "relative")
    zoom = next(fault for fault in FAULTS if fault.name == "camera zooms by 8 %")
    (one,) = flown(FaultJob(robot_file, config, 1000, (zoom.name,)))
    assert misses(zoom, one) == []
    assert one.excursion_mm < 20.0


def test_the_hazard_table_is_as_written_and_each_fault_has_a_hazard() -> None:
    assert (ROOT / "docs" / "hazards.md").read_text(encoding="utf-8") == hazards.document()
    numbers = [hazard.number for hazard in hazards.HAZARDS]
    assert len(set(numbers)) == len(numbers)
    assert {fault.hazard for fault in FAULTS if fault.hazard != "–"} <= set(numbers)


@pytest.mark.parametrize("hazard", hazards.HAZARDS, ids=lambda hazard: hazard.number)
def test_each_hazard_is_shown_by_a_fault_or_by_a_test_that_exists(hazard: hazards.Hazard) -> None:
    assert hazard.tests or any(fault.hazard == hazard.number for fault in FAULTS)
    for test in hazard.tests:
        path, _, name = test.partition("::")
        source = (ROOT / "tests" / path).read_text(encoding="utf-8")
        assert f"def {name}(" in source if name else "def test_" in source


def watched(thrust_n: list[float], away_m: float = 0.1) -> np.ndarray:
    t = 0.1 * np.arange(len(thrust_n))
    stage = (t >= 0.3).astype(int) + (t >= 1.0)
    return np.column_stack((t, thrust_n, np.full(len(t), away_m), stage))


def test_a_live_fault_is_judged_by_when_thrust_ends_and_that_it_stays_so() -> None:
    fault, before = LIVE[0], watched([2.0] * 10)
    falling = [2.0] * 11 + np.linspace(2.0, 0.0, 20).tolist() + [0.0] * 20
    down = outcome_of(fault, before, watched(falling, 0.12))
    assert (down.missed, down.after_zero) == ("", 0)
    assert down.falls_s == pytest.approx(1.4)
    assert down.zero_s == pytest.approx(3.0)
    assert (down.coasts_s, down.ramps_s) == (pytest.approx(0.3), pytest.approx(1.0))
    assert down.excursion_mm == pytest.approx(20.0)
    back = outcome_of(fault, before, watched([*falling, 1.0]))
    assert (back.after_zero, back.missed) == (1, "1 samples after zero")
    assert "met RAMP" in outcome_of(fault, before, watched(falling), "RAMP").missed
    never = outcome_of(fault, before, watched([2.0] * 60))
    assert "zero inf" in never.missed
    far = outcome_of(fault, before, watched(falling, 0.1 + 1e-3 * (FARTHEST_MM + 1.0)))
    assert far.missed == "strays 151 mm"
    said = [
        (-1.0, FaultStage.RAMPS),
        (0.12, FaultStage.FOLLOWS),
        (0.14, FaultStage.COASTS),
        (0.2, FaultStage.RAMPS),
    ]
    by_control = outcome_of(fault, before, watched(falling), of_control=said)
    assert (by_control.coasts_s, by_control.ramps_s) == (0.14, 0.2)
    followed = outcome_of(fault, before, watched([2.0, 2.0]))
    assert (followed.coasts_s, followed.ramps_s) == (float("inf"), float("inf"))


@pytest.mark.parametrize("more", [[], ["--live", "1"]], ids=["virtual", "live"])
def test_words_that_are_in_no_fault_s_name_are_no_success(
    more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["faults", "--only", "stop whlie", "--vanish", "0", *more]) == 2
    told = capsys.readouterr()
    assert "--only: 'stop whlie' is in no fault's name; there are: " in told.err
    assert "holds" not in told.out
