"""The whole loop in virtual time: it tracks, and it does so twice alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.simulation.trace import TrackingTrace
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation


def flight(seconds: float, seed: int = 5) -> TrackingTrace:
    scene = SimulationOptions(hand="steady", seed=seed, codec="jpeg")
    return VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene).run(seconds)


def test_the_robot_keeps_its_pose_to_a_hand_that_tries_to_be_still() -> None:
    trace = flight(5.0)
    assert trace.left == ""
    assert trace.t[-1] - trace.t[0] > 2.0
    assert trace.poses > 0.9 * trace.pictures
    distances = np.linalg.norm(np.array(trace.error_in_f), axis=1)
    assert np.sqrt(np.mean(distances**2)) < 0.015


@pytest.mark.slow
def test_the_same_seed_flies_the_same_flight() -> None:
    first, second = flight(3.4), flight(3.4)
    assert len(first.t) > 20
    np.testing.assert_array_equal(np.array(first.thrusts), np.array(second.thrusts))
    np.testing.assert_array_equal(np.array(first.body_in_f), np.array(second.body_in_f))


HALF_HIDDEN = SimulationOptions(
    hand="moving", seed=6, codec="jpeg", hidden=((3.0, 3.6, (0, 2, 4)), (3.6, 4.0, (0, 1, 2, 3)))
)


@pytest.mark.slow
def test_two_leds_and_then_one_are_enough_to_fly_on() -> None:
    trace = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), HALF_HIDDEN).run(4.6)
    assert trace.left == ""
    assert {0, 1, 2, 4, 5} >= set(trace.leds) >= {1, 2, 5}
    assert trace.leds.count(2) >= 16
    assert trace.leds.count(1) >= 10
    assert trace.poses == trace.leds.count(5) + trace.leds.count(4)
    errors = np.linalg.norm(np.array(trace.estimate_error_in_c), axis=1)
    assert errors.max() < 0.025


def test_a_scene_says_which_leds_are_hidden_when() -> None:
    scene = SimulationOptions(hidden=((1.0, 2.0, (0, 3)), (1.5, 3.0, (3, 4))))
    assert [scene.hidden_at(t) for t in (0.9, 1.0, 1.5, 2.0, 3.0)] == [
        (),
        (0, 3),
        (0, 3, 4),
        (3, 4),
        (),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("change", [{"latency_s": (0.2, 0.2)}, {"readout_s": 0.03}], ids=str)
def test_late_pictures_and_a_rolling_shutter_are_flown_with(change: dict[str, object]) -> None:
    scene = replace(SimulationOptions(hand="moving", seed=7, codec="jpeg"), **change)
    trace = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene).run(4.5)
    assert trace.left == ""
    assert trace.poses > 0.95 * trace.pictures
    distances = np.linalg.norm(np.array(trace.error_in_f), axis=1)
    assert np.sqrt(np.mean(distances**2)) < 0.02


@pytest.mark.slow
def test_of_two_robots_in_the_picture_the_right_one_is_led_even_when_it_goes_dark() -> None:
    dark = ((3.6, 4.0, (0, 1, 2, 3, 4)),)
    scene = SimulationOptions(hand="moving", seed=7, codec="jpeg", twin=True, hidden=dark)
    flight = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene)
    trace = flight.run(5.5)
    assert trace.left == ""
    assert trace.t[-1] > 5.4
    errors = np.linalg.norm(np.array(trace.estimate_error_in_c), axis=1)
    assert errors.max() < 0.05
    assert np.linalg.norm(np.array(trace.error_in_f), axis=1).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("twin_code", [None, 9])
def test_a_robot_that_blinks_is_led_and_no_other_though_it_is_dark_at_first(twin_code) -> None:
    every = (0, 1, 2, 3, 4)
    scene = SimulationOptions(
        hand="moving", seed=8, codec="jpeg", twin=True, twin_code=twin_code,
        hidden=((0.0, 0.6, every), (4.4, 4.8, every)),
    )  # fmt: skip
    robot_file = load_robot("ames")
    blinking = replace(robot_file, robot=replace(robot_file.robot, blinks=True))
    flight = VirtualTimeSimulation(blinking, TeleopConfig(), scene)
    kept_dark = []
    while flight.t < 6.0 and not flight.trace.left:
        flight.advance()
        if flight.follower.dark >= 0:
            kept_dark.append(flight.t)
    trace = flight.trace
    assert trace.left == ""
    assert trace.t[-1] > 5.9
    assert {0, 5} <= set(trace.leds)
    assert np.linalg.norm(np.array(trace.estimate_error_in_c), axis=1).max() < 0.05
    assert min(kept_dark) < 0.6
    assert not any(2.5 < t < 4.4 for t in kept_dark)  # who is tracked shines
