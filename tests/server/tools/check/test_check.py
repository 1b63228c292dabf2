"""`lightleash check`: each line turns bad by what it is about, and only by that."""

from __future__ import annotations

import json
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as with_fields

from pipeline.signals import PhoneImu
from pipeline.vision.detection import Detection
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Motion
from server.recording.reader import Recording, read
from server.tools.check.command import POOR, REFUSED, main
from server.tools.check.page import page
from server.tools.check.recorded_phone import PhoneFigures, RecordedPhone
from server.tools.check.verdicts import verdicts, worst

FLIGHT = Path(__file__).parents[3] / "data" / "virtual_phone.mcap"
FIGURES = tuple(PhoneFigures.__dataclass_fields__)


@pytest.fixture(scope="module")
def found() -> PhoneFigures:
    return RecordedPhone(read(FLIGHT)).figures()


@pytest.fixture(scope="module")
def fine(found: PhoneFigures) -> PhoneFigures:
    """The same, of a phone that had time to show everything."""
    assert found.camera is not None
    camera = with_fields(
        found.camera,
        complaint="",
        hint="",
        exposure_ms=4.0,
        time_offset_ms=1.0,
        time_offset_sigma_ms=1.0,
        larger_percent=0.1,
        larger_sigma_percent=0.2,
        held_percent=1.0,
        held_sigma_percent=1.0,
    )
    return replace(
        found,
        picture_hz=30.0,
        gyro_bias_deg_s=0.2,
        gravity_m_s2=9.81,
        slower_pct=0.0,
        complaints=(),
        camera=camera,
        link=with_fields(found.link, grade="good", advice=[]),
    )


def test_a_virtual_phone_shows_what_it_was_made_with(found: PhoneFigures) -> None:
    """20 pictures a second that come after 60 to 120 ms, 60 motion samples, a clock 40 ppm fast."""
    assert found.picture_hz == pytest.approx(20.0, rel=0.01)
    assert found.clock_ppm == pytest.approx(40.0, abs=5.0)
    assert found.motion_hz == pytest.approx(60.0, rel=0.05)
    p50, p95, p99 = found.age_ms
    assert 60.0 < p50 < p95 <= p99 < 125.0
    assert found.lost_pct < 1.0
    assert found.found_pct > 95.0
    assert 0.0 < found.noise_px < 0.3
    assert found.complaints == ()


class Thinned(RecordedPhone):
    """Of which every tenth picture is lost on its way."""

    def __init__(self, recording: Recording) -> None:
        self.came, self.residuals = 0, list[float]()
        super().__init__(recording)

    def _on_detection(self, frame: EncodedFrame, detection: Detection | None) -> None:
        self.came += 1
        if detection is not None and detection.pose is not None:
            assert detection.pose.leds == 5
            self.residuals.append(detection.pose.reprojection_px)
        if self.came % 10 != 5:
            super()._on_detection(frame, detection)


def test_pictures_that_are_missing_are_counted_and_residuals_are_no_noise_yet() -> None:
    """Five LEDs leave 10 − 6 of their coordinates' errors to be seen: σ² = 5 r² / 4."""
    thinned = Thinned(read(FLIGHT))
    found = thinned.figures()
    assert found.lost_pct == pytest.approx(10.0, abs=1.5)
    assert found.noise_px == pytest.approx(1.118 * np.median(thinned.residuals), rel=0.05)


class Humming(RecordedPhone):
    """Which something beside it shakes, beyond half of the sample rate."""

    def _on_motion(self, sample: PhoneImu, motion: Motion, now: float) -> None:
        shaken = np.array([0.0, 1.5, 0.0]) * np.sin(2.0 * np.pi * 41.0 * sample.t)
        super()._on_motion(replace(sample, a_m_cf_in_c=sample.a_m_cf_in_c + shaken), motion, now)


def test_a_vibration_is_said_of_the_sensor_that_feels_it() -> None:
    complaints = Humming(read(FLIGHT)).figures().complaints
    assert complaints == (
        "The phone's accelerometer feels a vibration, as of a propeller or a motor.",
    )


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
        ("After a while", {"slower_pct": 30.0}),
        ("Motion samples", {"motion_hz": 20.0}),
        ("Motion samples", {"motion_silence_ms": 200.0}),
        ("Gyroscope at rest", {"gyro_bias_deg_s": 4.0}),
        ("Gravity at rest", {"gravity_m_s2": 9.0}),
        ("Clock", {"clock_ppm": -400.0}),
        ("Robot found", {"found_pct": 50.0}),
        ("LEDs in the picture", {"noise_px": 1.0}),
        ("It was said", {"complaints": ("The camera stabilises.",)}),
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
    bad = with_fields(fine.camera, **changes)
    lines = verdicts(replace(fine, camera=bad))
    assert [line.what for line in lines if line.grade == "poor"] == [what]
    name = next(iter(changes)).rsplit("_", 1)
    unsure = with_fields(bad, **{f"{name[0]}_sigma_{name[1]}": 100.0})
    assert worst(verdicts(replace(fine, camera=unsure))) == "good"


@pytest.mark.parametrize(
    "changes",
    [
        {"gyro_bias_deg_s": nan},
        {"gravity_m_s2": nan},
        {"noise_px": nan},
        {"clock_ppm": nan},
        {"camera": None},
        {"by_arrival": True},
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


def test_a_devices_name_never_becomes_markup(fine: PhoneFigures) -> None:
    text = page(replace(fine, device="<script>alert(1)</script>"), verdicts(fine))
    assert "<script>" not in text
    assert "&lt;script&gt;" in text


def test_the_command_writes_all_figures_and_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told, shown = tmp_path / "check.json", tmp_path / "check.html"
    code = main([str(FLIGHT), "--json", str(told), "--html", str(shown)])
    answer = json.loads(told.read_text())
    assert code == (POOR if answer["grade"] == "poor" else 0)
    assert set(answer["figures"]) == set(FIGURES)
    printed = capsys.readouterr().out
    for line in answer["lines"]:
        assert line["what"] in printed
        assert line["what"] in shown.read_text()


def test_what_is_no_recording_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "no.mcap"
    path.write_bytes(b"nothing")
    assert main([str(path)]) == REFUSED
    assert capsys.readouterr().err.count("\n") == 1
