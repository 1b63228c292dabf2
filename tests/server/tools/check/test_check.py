"""`lightleash check`: what a recording shows of its phone is what that was made with."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.signals import PhoneImu
from pipeline.vision.detection import Detection
from server.diagnostics.phone_check.figures import PhoneFigures
from server.phone.ingest import EncodedFrame
from server.protocol.wire_records import Motion
from server.recording.reader import Recording, read
from server.tools.check.command import POOR, REFUSED, main
from server.tools.check.recorded_phone import RecordedPhone

FLIGHT = Path(__file__).parents[3] / "data" / "virtual_phone.mcap"
FIGURES = tuple(PhoneFigures.__dataclass_fields__)


@pytest.fixture(scope="module")
def found() -> PhoneFigures:
    return RecordedPhone(read(FLIGHT)).figures()


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
    assert len(found.dots_px) == 5
    assert min(found.dots_px) > 0.0
    assert 0.0 <= found.codec_pct < 100.0
    assert found.axes == "up"  # five seconds of turning are too few for the rest
    assert found.glass is None


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
