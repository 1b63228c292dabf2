"""What a phone's figures mean: each line turns bad by what it is about, and only by that."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import pytest
from msgspec.structs import replace as with_fields

from server.diagnostics.phone_check.figures import PhoneFigures
from server.diagnostics.phone_check.page import page
from server.diagnostics.phone_check.verdicts import verdicts, worst
from tests.server.diagnostics.phone_check.fine_phone import FINE, GLASS


@pytest.fixture
def fine() -> PhoneFigures:
    return FINE


def test_nothing_speaks_against_a_fine_phone(fine: PhoneFigures) -> None:
    lines = verdicts(fine)
    assert {line.grade for line in lines} == {"good"}
    assert not any(line.advice for line in lines)
    assert worst(lines) == "good"


@pytest.mark.parametrize(
    ("what", "changes"),
    [
        ("Pictures", {"picture_hz": 14.0}),
        ("Lost pictures", {"lost_pct": 6.0}),
        ("Age of pictures", {"age_ms": (80.0, 210.0, 300.0)}),
        ("Heat", {"end_hz": 20.0}),
        ("Motion samples", {"motion_hz": 20.0}),
        ("Motion samples", {"motion_silence_ms": 200.0}),
        ("Gyroscope at rest", {"gyro_bias_deg_s": 4.0}),
        ("Gravity at rest", {"gravity_m_s2": 9.0}),
        ("Clock", {"clock_ppm": -400.0}),
        ("Robot found", {"found_pct": 50.0}),
        ("LEDs in the picture", {"noise_px": 1.0}),
        ("It was said", {"complaints": ("The camera stabilises.",)}),
        ("Screen's delay", {"glass": replace(GLASS, lag_ms=90.0)}),
        ("Screen's delay", {"glass": replace(GLASS, lag_ms=-40.0)}),
        ("Light to server", {"glass": replace(GLASS, light_ms=(100.0, 290.0, 300.0))}),
        ("Focal length", {"glass": replace(GLASS, focal_pct=-5.0)}),
        ("Stabilisation", {"glass": replace(GLASS, held_pct=60.0)}),
    ],
)
def test_each_line_is_poor_by_what_it_is_about(
    fine: PhoneFigures, what: str, changes: dict[str, object]
) -> None:
    lines = verdicts(replace(fine, **changes))
    assert [line.what for line in lines if line.grade != "good"] == [what]
    (line,) = (line for line in lines if line.what == what)
    assert line.grade == "poor"
    assert line.advice or what == "It was said"
    assert worst(lines) == "poor"


@pytest.mark.parametrize(
    ("what", "changes"),
    [
        ("Dates of pictures", {"time_offset_ms": -30.0}),
        ("Lens", {"larger_percent": 8.0}),
        ("Stabilisation", {"held_percent": 60.0}),
    ],
)
def test_the_camera_is_judged_by_what_is_sure_of_it(
    fine: PhoneFigures, what: str, changes: dict[str, float]
) -> None:
    assert fine.camera is not None
    bad, alone = with_fields(fine.camera, **changes), replace(fine, glass=None)
    lines = verdicts(replace(alone, camera=bad))
    assert [line.what for line in lines if line.grade == "poor"] == [what]
    name = next(iter(changes)).rsplit("_", 1)
    unsure = with_fields(bad, **{f"{name[0]}_sigma_{name[1]}": 100.0})
    assert worst(verdicts(replace(alone, camera=unsure))) == "good"


@pytest.mark.parametrize(
    "changes",
    [
        {"gyro_bias_deg_s": nan},
        {"gravity_m_s2": nan},
        {"noise_px": nan},
        {"clock_ppm": nan},
        {"camera": None},
        {"by_arrival": True},
        {"axes": "unknown"},
        {"axes": "up"},
        {"glass": replace(GLASS, focal_pct=nan, focal_sigma_pct=nan)},
        {"glass": replace(GLASS, lag_ms=nan, lag_sigma_ms=nan)},
        {"glass": replace(GLASS, light_ms=(nan, nan, nan))},
        {"glass": replace(GLASS, held_pct=nan, held_sigma_pct=nan)},
    ],
)
def test_what_nobody_knows_is_said_and_spoils_nothing(
    fine: PhoneFigures, changes: dict[str, object]
) -> None:
    lines = verdicts(replace(fine, **changes))
    (line,) = (line for line in lines if line.grade != "good")
    assert line.grade == "unknown"
    assert "nan" not in line.value
    assert "unknown" in line.value
    assert line.advice


def test_without_a_screen_nothing_is_said_of_one_and_without_five_minutes_nothing_of_heat(
    fine: PhoneFigures,
) -> None:
    told = {line.what for line in verdicts(fine)}
    less = verdicts(replace(fine, glass=None, begin_hz=nan, end_hz=nan))
    assert told - {line.what for line in less} == {
        "Screen's delay",
        "Light to server",
        "Focal length",
        "Heat",
    }
    assert worst(less) == "good"


def test_a_lens_of_no_calibration_is_named_and_is_to_be_calibrated(fine: PhoneFigures) -> None:
    (line,) = (one for one in verdicts(replace(fine, is_calibrated=False)) if one.grade != "good")
    assert (line.what, line.grade) == ("Focal length", "fair")
    assert "998 px" in line.value
    assert "Calibrate this camera" in line.advice


def test_a_picture_that_turns_too_much_is_not_called_steadied(fine: PhoneFigures) -> None:
    assert worst(verdicts(replace(fine, glass=replace(GLASS, held_pct=-11.0)))) == "good"


def test_a_focal_length_that_may_as_well_be_right_is_not_blamed(fine: PhoneFigures) -> None:
    unsure = replace(GLASS, focal_pct=-5.0, focal_sigma_pct=3.0)
    assert worst(verdicts(replace(fine, glass=unsure))) == "good"


def test_what_dates_are_by_arrival_is_not_said_to_scatter(fine: PhoneFigures) -> None:
    late = replace(GLASS, light_ms=(100.0, 900.0, 900.0))
    lines = verdicts(replace(fine, by_arrival=True, glass=late))
    assert [one.value for one in lines if one.what == "Light to server"] == [
        "100 ms in the middle; how it scatters is unknown"
    ]


def test_a_devices_name_never_becomes_markup(fine: PhoneFigures) -> None:
    text = page(replace(fine, device="<script>alert(1)</script>"), verdicts(fine))
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
