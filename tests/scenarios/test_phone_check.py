"""A phone before a screen is checked: each line holds the truth that was put into the flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.sim.camera_faults import CameraFault
from hardware.sim.phone import PhoneOptions
from pipeline.camera.extrinsics import Extrinsics
from pipeline.frames import Array
from server.diagnostics.phone_check.figures import GlassFigures
from server.diagnostics.phone_check.report import CheckReport
from server.simulation.virtual_time import SimulationOptions
from server.virtual_phone.phone_script import DEVICE
from tests.scenarios.phone_check import CheckedScreen

pytestmark = pytest.mark.slow
LONGER = 1.04
"""The stored calibration's focal length, of the true one."""
DOT_NOISE_M = 2e-4
EARLY_S = 0.010
"""Pictures are dated too early by so much, and nobody knows."""
CAMERA = find_camera(DEVICE, 1280, 720)


def flown(simulation: CheckedScreen, seconds: float) -> CheckReport:
    while simulation.t < seconds:
        simulation.advance()
    return simulation.answer().report


def ways_ms(simulation: CheckedScreen) -> Array:
    """Median, p95 and p99 of the true times from exposure to arrival."""
    events = simulation.phone.pictures.deliveries(0.2, simulation.t)
    took = [1e3 * (event.t_deliver - event.t_capture) for event in events]
    return np.percentile(took, (50.0, 95.0, 99.0))


def drawn_ms(simulation: CheckedScreen) -> float:
    """How long before it was filmed light had been drawn: the lag, and how long frames stay."""
    return 1e3 * float(np.mean(simulation.drawn_before_s))


def glass_of(report: CheckReport) -> GlassFigures:
    assert report.figures.glass is not None
    return report.figures.glass


def grades(report: CheckReport) -> dict[str, str]:
    return {line.what: line.grade for line in report.lines}


@pytest.fixture(scope="module")
def poor() -> tuple[CheckedScreen, CheckReport]:
    """Pictures get lost, dots are not where they should be, the lens is another one."""
    K = CAMERA.K.copy()
    K[:2, :2] *= LONGER
    scene = SimulationOptions(hand="moving", seed=1000, latency_s=(0.10, 0.14), codec="jpeg")
    simulation = CheckedScreen(
        scene, lose_every=10, dot_noise_m=DOT_NOISE_M, stored=replace(CAMERA, K=K)
    )
    return simulation, flown(simulation, 14.0)


@pytest.fixture(scope="module")
def steadied() -> tuple[CheckedScreen, CheckReport]:
    """The picture is stabilised."""
    sensors = PhoneOptions(camera_fault=CameraFault.ELECTRONIC)
    simulation = CheckedScreen(SimulationOptions(hand="filming", seed=1000, sensors=sensors))
    return simulation, flown(simulation, 7.0)


@pytest.fixture(scope="module")
def misdated() -> tuple[CheckedScreen, CheckReport]:
    """Pictures are dated wrongly."""
    extrinsics = Extrinsics(time_offset_s=EARLY_S)
    scene = SimulationOptions(
        hand="moving", seed=1000, extrinsics=extrinsics, knows_extrinsics=False
    )
    simulation = CheckedScreen(scene)
    return simulation, flown(simulation, 6.0)


def test_the_screens_delay_and_the_way_of_light_are_those_that_were_flown(
    poor: tuple[CheckedScreen, CheckReport],
) -> None:
    simulation, report = poor
    glass = glass_of(report)
    assert glass.lag_ms == pytest.approx(drawn_ms(simulation), abs=3.0)
    assert report.figures.age_ms == pytest.approx(ways_ms(simulation), abs=4.0)
    assert glass.light_ms == pytest.approx(ways_ms(simulation) + drawn_ms(simulation), abs=5.0)


def test_wrong_dates_are_in_lag_and_age_and_not_in_their_sum(
    misdated: tuple[CheckedScreen, CheckReport],
) -> None:
    simulation, report = misdated
    glass, early_ms = glass_of(report), 1e3 * EARLY_S
    assert glass.lag_ms == pytest.approx(drawn_ms(simulation) - early_ms, abs=3.0)
    assert report.figures.age_ms == pytest.approx(ways_ms(simulation) + early_ms, abs=4.0)
    assert glass.light_ms == pytest.approx(ways_ms(simulation) + drawn_ms(simulation), abs=5.0)


def test_a_calibration_of_another_lens_is_found_by_the_screen(
    poor: tuple[CheckedScreen, CheckReport],
) -> None:
    glass = glass_of(poor[1])
    wrong_pct = 100.0 * (1.0 / LONGER - 1.0)
    assert glass.focal_pct == pytest.approx(wrong_pct, abs=3.0 * glass.focal_sigma_pct)
    assert glass.focal_sigma_pct < 0.5
    assert grades(poor[1])["Focal length"] == "poor"


def test_pixels_are_as_noisy_as_dots_are_shown(poor: tuple[CheckedScreen, CheckReport]) -> None:
    report, distance_m = poor[1], 0.6
    noise_px = DOT_NOISE_M * CAMERA.focal_px / distance_m
    rms_px = float(np.sqrt(np.mean(np.square(report.figures.dots_px))))
    assert rms_px == pytest.approx(noise_px, rel=0.2)
    assert report.figures.noise_px == pytest.approx(noise_px, rel=0.25)
    assert report.figures.codec_pct > 70.0
    assert grades(report)["LEDs in the picture"] == "fair"


def test_pictures_that_were_lost_are_counted_and_none_where_none_was(
    poor: tuple[CheckedScreen, CheckReport], steadied: tuple[CheckedScreen, CheckReport]
) -> None:
    assert poor[1].figures.lost_pct == pytest.approx(10.0, abs=0.5)
    assert poor[1].figures.picture_hz == pytest.approx(27.0, rel=0.02)
    assert grades(poor[1])["Lost pictures"] == "poor"
    assert steadied[1].figures.lost_pct < 0.5


def test_a_picture_that_is_stabilised_is_told_from_one_that_is_not(
    poor: tuple[CheckedScreen, CheckReport], steadied: tuple[CheckedScreen, CheckReport]
) -> None:
    assert glass_of(steadied[1]).held_pct > 70.0
    assert grades(steadied[1])["Stabilisation"] == "poor"
    honest = glass_of(poor[1])
    assert honest.held_pct < honest.held_sigma_pct
    assert grades(poor[1])["Stabilisation"] == "good"


def test_motion_sensors_and_clock_are_those_of_the_phone(
    poor: tuple[CheckedScreen, CheckReport],
) -> None:
    simulation, report = poor
    found, phone = report.figures, simulation.phone
    bias_deg_s = np.rad2deg(float(np.linalg.norm(phone._bias_omega)))
    assert found.motion_hz == pytest.approx(phone.options.motion_rate_hz, rel=0.02)
    assert found.gyro_bias_deg_s == pytest.approx(bias_deg_s, abs=0.05)
    assert found.gravity_m_s2 == pytest.approx(9.81, abs=0.15)
    assert found.clock_ppm == pytest.approx(phone.clock.drift_ppm, abs=5.0)
    assert grades(report)["Axes of motion"] == "unknown"  # up is known, turns are too small
