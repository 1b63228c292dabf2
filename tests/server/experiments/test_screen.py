"""`experiments screen`: what it promises is missed by what each promise is about."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.control.process import teleop_config
from server.experiments.screen import (
    PRESS_S,
    REAL,
    RefusedScreen,
    ScreenCase,
    ScreenFlight,
    ScreenSetting,
    cases,
    fly,
    goals,
    refused,
    rows_of,
    unfit,
)

FLOWN = [
    ScreenFlight(REAL, 1000, 3.0, 9.0, 0.0, nan, nan, ""),
    ScreenFlight(REAL, 1001, 4.0, 8.0, 0.0, nan, nan, ""),
    ScreenFlight("40 ms", 1000, 4.0, 11.0, 10.0, 48.0, 46.0, ""),
    ScreenFlight("40 ms", 1001, 4.5, 10.0, 30.0, 48.0, 49.0, ""),
]
REFUSED = [RefusedScreen("100 ms", False, "too late")]


def test_a_row_is_over_all_flights_and_names_the_worst() -> None:
    real, late = rows_of(FLOWN)
    assert real.ratio == 1.0
    assert (late.flights, late.worst_mm, late.max_mm) == (2, 4.5, 11.0)
    assert late.ratio == pytest.approx(((4.0**2 + 4.5**2) / (3.0**2 + 4.0**2)) ** 0.5)
    assert late.beyond_pct == 20.0
    assert late.off_ms == -2.0


@pytest.mark.parametrize(
    ("changes", "missed"),
    [
        ({}, ""),
        ({"rms_mm": 6.0}, "40 ms: RMS"),
        ({"rms_mm": nan}, "40 ms: RMS"),
        ({"found_ms": 52.0}, "lags found"),
        ({"found_ms": nan}, "lags found"),
        ({"ended": "8 s: fault"}, "no flight ended"),
    ],
)
def test_each_goal_is_missed_by_what_it_is_about(
    changes: dict[str, float | str], missed: str
) -> None:
    held = goals(rows_of([*FLOWN[:-1], replace(FLOWN[-1], **changes)]), REFUSED)
    assert len(held) == 4
    assert [goal for goal, good in held.items() if not good] == [
        goal for goal in held if missed and goal.startswith(missed)
    ]


@pytest.mark.parametrize(
    "refusal", [RefusedScreen("100 ms", True, "too late"), RefusedScreen("100 ms", False, "")]
)
def test_what_must_be_refused_is_neither_flown_nor_left_without_a_word(
    refusal: RefusedScreen,
) -> None:
    held = goals(rows_of(FLOWN), [refusal])
    assert [goal for goal, good in held.items() if not good] == ["100 ms: not flown, and told why"]


def test_every_case_is_another_one() -> None:
    names = [case.name for case in (*cases(), *unfit())]
    assert len(set(names)) == len(names)
    assert all(case.display is None for case in cases() if case.name == REAL)


@pytest.mark.slow
def test_how_far_it_is_off_where_it_is_led_beyond_its_reach_counts_for_nothing() -> None:
    """The hand of this seed leads a third of the way to where no thruster holds the robot."""
    robot_file = load_robot("screen")
    config = teleop_config(robot_file, "phone", TeleopConfig().virtual_camera, "relative")
    setting = ScreenSetting(robot_file, config, "moving")
    flight = fly(setting, 8.0, (ScreenCase(REAL), 1003))
    assert not flight.ended
    assert flight.beyond_pct > 20.0
    assert flight.rms_mm < 5.0
    trace = setting.real(1003).run(PRESS_S + 8.0)
    assert max(abs(error).max() for error in trace.error_in_f) > 0.02


@pytest.mark.slow
def test_a_glass_without_fiducials_is_not_flown() -> None:
    robot_file = load_robot("screen")
    config = teleop_config(robot_file, "phone", TeleopConfig().virtual_camera, "relative")
    (case,) = (one for one in unfit() if one.name == "no fiducials")
    found = refused(ScreenSetting(robot_file, config, "steady"), 1000, case)
    assert not found.is_flown
    assert "Point the phone at the screen" in found.why
