"""A phone that films a screen leads a robot which is only light."""

from dataclasses import replace

import pytest

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.hand import make_hand
from hardware.sim.phone import PhoneOptions
from pipeline.camera.simple_lens import SimpleLens
from pipeline.config import TeleopConfig
from server.control.process import teleop_config
from server.experiments.screen import uncalibrated
from server.simulation.figures import result_of
from server.simulation.screen import Display, ScreenSimulation
from server.simulation.virtual_time import SimulationOptions

SCREEN = load_robot("screen")
CONFIG = teleop_config(SCREEN, "phone", TeleopConfig().virtual_camera, "relative")


def flight(display, seed):
    """A simulation that is not flown yet."""
    return ScreenSimulation(SCREEN, CONFIG, SimulationOptions(hand="moving", seed=seed), display)


@pytest.mark.slow
def test_a_phone_before_a_screen_measures_its_lag_and_leads_the_robot_of_light():
    simulation = flight(Display(lag_s=0.04), seed=1000)
    figures = result_of(simulation.run(9.0), simulation.scene, 0.0)
    lag = simulation.robot_of_light.lag
    assert {"search", "sweep", "robot"} <= simulation.phases
    # a frame stays for 17 ms: what a phone sees is between 0 and so much later
    assert 0.037 < lag.value < 0.040 + 0.020
    assert figures.tracked_s > 2.0
    assert not figures.ended
    assert figures.rms_mm < 8.0


@pytest.mark.slow
@pytest.mark.parametrize(("pictures_hz", "late_s"), [(5.0, (0.06, 0.10)), (7.0, (0.15, 0.25))])
def test_few_and_late_pictures_lead_a_robot_of_light(pictures_hz, late_s):
    hand = make_hand("moving", seed=1000, start=SCREEN.start, rest_s=8.0)
    scene = SimulationOptions(hand="moving", seed=1000, frame_rate_hz=pictures_hz, latency_s=late_s)
    simulation = ScreenSimulation(SCREEN, CONFIG, scene, Display(), hand=hand)
    shown = set()
    while simulation.t < 17.0 and not simulation.trace.left:
        simulation.advance()
        shown |= {simulation.shows.phase} if simulation.trace.t else set()
    figures = result_of(simulation.trace, simulation.scene, 0.0)
    assert shown == {"robot"}, "nor does the light go out for a moment"
    assert figures.tracked_s > 5.0
    assert not figures.ended
    assert figures.rms_mm < 8.0


@pytest.mark.slow
@pytest.mark.parametrize("distance_m", [0.8, 1.2])
def test_from_wherever_the_glass_is_seen_its_lag_is_measured_in_three_seconds(distance_m):
    """From farther away the fiducials seem brighter than the light that sweeps."""
    there = replace(SCREEN, start=replace(SCREEN.start, distance=distance_m))
    scene = SimulationOptions(hand="still", seed=1000)
    simulation = ScreenSimulation(there, CONFIG, scene, Display(lag_s=0.04))
    simulation.run(3.6)
    assert "robot" in simulation.phases
    assert abs(simulation.robot_of_light.lag.value - 0.044) < 0.004


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1000, 1002])
def test_a_lag_believed_20_ms_too_short_costs_no_more_than_its_first_seconds(seed):
    """What lights that come late seem to say of the pictures' dates is not believed."""
    simulation = flight(Display(lag_s=0.06, believed_lag_s=0.048), seed)
    figures = result_of(simulation.run(9.0), simulation.scene, 0.0)
    offset = simulation.robot_of_light.time_offset
    assert abs(offset.value) < 1e-3
    told = simulation._frame_pipeline.front_end._stamps.offset  # by the glass
    assert told.value == pytest.approx(offset.value, abs=1e-4)
    assert figures.tracked_s > 4.5
    assert not figures.ended
    assert figures.rms_mm < 6.0


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "rest_s"), [(1012, 0.0), (1000, 8.0), (1001, 8.0)])
def test_an_arm_is_led_as_a_robot_of_light(seed, rest_s):
    """Also by a hand that rests first: its light goes on ahead by what it was told, no picture's
    time is to be learnt by that."""
    arm = load_robot("so101", takes=COMMANDS)
    hand = make_hand("filming", seed=seed, start=arm.start, rest_s=rest_s)
    scene = SimulationOptions(hand="filming", seed=seed, frame_rate_hz=15.0)
    simulation = ScreenSimulation(arm, TeleopConfig(), scene, Display(), hand=hand)
    figures = result_of(simulation.run(10.5), simulation.scene, 0.0)
    assert figures.tracked_s > 3.0
    assert not figures.ended
    assert figures.rms_mm < 20.0
    assert figures.rms_deg < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("misdated_s", [0.04, 0.07, -0.03])
def test_pictures_that_a_phone_dates_wrongly_are_dated_by_the_glass(misdated_s):
    """Control and what is drawn go by the same dates, or the light is for another moment."""
    sensors = PhoneOptions(misdated_s=misdated_s)
    scene = SimulationOptions(hand="moving", seed=1000, sensors=sensors)
    simulation = ScreenSimulation(SCREEN, CONFIG, scene, Display(lag_s=0.046))
    figures = result_of(simulation.run(12.0), simulation.scene, 4.0)
    light = simulation.robot_of_light
    assert light.time_offset.value == pytest.approx(misdated_s, abs=0.002)
    assert 0.044 < light.lag.value < 0.046 + 0.020  # a frame stays for 17 ms
    assert light.dated_lag.value == pytest.approx(light.lag.value - misdated_s, abs=0.002)
    assert not figures.ended
    assert figures.rms_mm < 9.0


@pytest.mark.slow
def test_a_television_that_is_too_late_is_refused_and_not_flown():
    simulation = flight(Display(lag_s=0.1), seed=1001)
    simulation.run(4.0)
    assert simulation.robot_of_light.lag.value > 0.09
    assert "robot" not in simulation.phases
    assert not simulation.trace.t
    assert "too late" in simulation.shows.why


@pytest.mark.slow
def test_a_phone_that_nobody_calibrated_leads_with_the_lens_that_the_screen_measured():
    camera = uncalibrated(0.70, 0.02)
    scene = SimulationOptions(hand="moving", seed=1000, camera=camera, knows_camera=False)
    simulation = ScreenSimulation(SCREEN, CONFIG, scene, Display())
    figures = result_of(simulation.run(11.0), simulation.scene, 0.0)
    assert figures.tracked_s > 2.0
    assert not figures.ended
    assert figures.rms_mm < 8.0
    found = simulation.camera_in_use.focal_px / camera.focal_px
    assert abs(found - 1.0) < 0.06 < SimpleLens().focal / 0.70 - 1.0
