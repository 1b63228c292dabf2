"""Motion samples that come again under a new time end no flight, and turn no robot."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.experiments.forked import forked
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

SETTLED_S, BEGIN_S, AFTER_S = 13.9, 14.0, 4.0
MOST_M, MOST_RATIO = 0.01, 1.5
"""Beyond what the robot strays while sensors are silent for as long, some 0.04 s earlier."""


def settled(hand: str, seed: int) -> VirtualTimeSimulation:
    """Flown until just before its sensors fail."""
    robot_file = load_robot("ames")
    scene = SimulationOptions(hand=hand, seed=seed, led_noise_px=0.05, latency_s=(0.06, 0.09))
    flight = VirtualTimeSimulation(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), scene)
    flight.checks_rays = True
    while flight.t < SETTLED_S and not flight.trace.left:
        flight.advance()
    return flight


def farthest(flight: VirtualTimeSimulation, seconds: float, *, silent: bool) -> float:
    """While and after the sensors stand still, or are silent [m]."""
    if not silent:
        flight.phone.stands_still = BEGIN_S, BEGIN_S + seconds
    while flight.t < BEGIN_S + AFTER_S and not flight.trace.left:
        is_silent = silent and BEGIN_S <= flight.t < BEGIN_S + seconds
        flight.lost = {"motion"} if is_silent else set()
        flight.advance()
    trace = flight.trace
    assert trace.left == ""
    errors = np.linalg.norm(np.array(trace.error_in_f), axis=1)
    return float(errors[np.array(trace.t) >= BEGIN_S].max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.parametrize("hand", ["moving", "filming"])
def test_sensors_that_stand_still_for_a_moment_are_a_gap(hand: str, seed: int) -> None:
    flight = settled(hand, seed)
    for seconds in (0.07, 0.15, 0.4):
        held, silent = (
            forked(partial(farthest, flight, seconds, silent=one)) for one in (False, True)
        )
        assert held < MOST_M + MOST_RATIO * silent, f"{seconds} s"
