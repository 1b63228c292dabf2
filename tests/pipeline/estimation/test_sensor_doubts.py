"""What is doubted is said, of the sensor that is at fault, and of none that only a hand moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hardware.sim.measured_hands import MEASURED
from hardware.sim.world.sensor_faults import ImuFault
from hardware.sim.world.sensors import feed
from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.estimator_config import RelativeConfig

ASKED_S = 0.1
SHAKEN = "The phone's accelerometer is moved beyond the end of its range."


def said(options: WorldOptions) -> list[tuple[float, tuple[str, ...]]]:
    """All doubts of a flight, ten times a second, with their times [s]."""
    estimator, world, told, due = (
        RelativeFilter(RelativeConfig(), LEDS_IN_B),
        World(options),
        [],
        0.0,
    )
    for now, _ in feed(estimator, world):
        if now >= due:
            due = now + ASKED_S
            told.append((now, estimator.health.doubts))
    return told


@pytest.mark.slow
def test_a_gyroscope_that_steps_is_told_of_most_hands() -> None:
    """Which way a hand turns decides how soon: of 12 hands 12 were told, of half the step 8."""
    within_s = []
    for seed in range(2, 8):
        step = ImuFault(step=(0.1, 0.0), start=6.0)
        told = said(WorldOptions(seed=seed, duration=11.0, phone_fault=step))
        times = [t for t, doubts in told if any("A gyroscope of the" in one for one in doubts)]
        assert times
        within_s.append(times[0] - 6.0)
    assert min(within_s) > 0.0
    assert float(np.median(within_s)) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("hand", ["", *sorted(set(MEASURED) - {"shaken"})])
def test_of_sound_sensors_nothing_is_said(hand: str) -> None:
    assert {words for _, words in said(WorldOptions(seed=3, duration=8.0, hand=hand))} == {()}


@pytest.mark.slow
def test_a_shaken_phone_is_said_to_be_while_it_is_and_three_seconds_more() -> None:
    told = said(WorldOptions(seed=5, duration=12.0, hand="shaken"))
    times = [t for t, words in told if SHAKEN in words]
    assert times
    assert {words for _, words in told} == {(), (SHAKEN,)}
    assert told[-1][1] == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "begins", "words"),
    [
        ({"body_fault": ImuFault(noise=20.0)}, 0.0, "The robot's accelerometer is much noisier"),
        ({"body_fault": ImuFault(noise=20.0)}, 0.0, "The robot's gyroscope is much noisier"),
        ({"pixel_noise": 2.5}, 0.0, "LEDs are seen much less exactly"),
        ({"date_jitter": 0.006}, 0.0, "Pictures are dated less exactly"),
        (
            {"body_fault": ImuFault(step=(0.0, 0.5), start=6.0)},
            6.0,
            "An accelerometer of the robot",
        ),
        (
            {"body_fault": ImuFault(tone=(0.0, 3.0), tone_hz=80.0)},
            4.0,
            "The robot's accelerometer feels a vibration",
        ),
        (
            {"body_fault": ImuFault(tone=(0.3, 0.0), tone_hz=280.0)},
            4.0,
            "The robot's gyroscope feels a vibration",
        ),
        (
            {"phone_fault": ImuFault(tone=(0.0, 2.0), tone_hz=80.0), "hand": "filming"},
            4.0,
            "The phone's accelerometer feels a vibration",
        ),
        (
            {"body_fault": ImuFault(tone=(0.0, 3.0), tone_hz=203.0)},
            4.0,
            "The robot's accelerometer sways",
        ),
        (
            {"body_fault": ImuFault(tone=(0.3, 0.0), tone_hz=206.0)},
            4.0,
            "The robot's gyroscope sways",
        ),
        (
            {"body_fault": ImuFault(tone=(0.0, 3.0), tone_hz=397.0)},
            4.0,
            "The robot's accelerometer sways",
        ),
        (
            {"phone_fault": ImuFault(tone=(0.0, 2.0), tone_hz=62.0), "hand": "filming"},
            4.0,
            "An accelerometer of the robot or the phone sways",
        ),
    ],
)
def test_a_fault_is_said_within_four_seconds(
    fault: dict[str, Any], begins: float, words: str
) -> None:
    told = said(WorldOptions(seed=2, duration=11.0, **fault))
    times = [t for t, doubts in told if any(one.startswith(words) for one in doubts)]
    assert begins < times[0] < begins + 4.0
