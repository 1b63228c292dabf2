"""Motion samples that come again under a new time end no flight, and turn no robot."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

BEGIN_S, AFTER_S = 14.0, 4.0
MOST_M, MOST_RATIO = 0.01, 1.5
"""Beyond what the robot strays while sensors are silent for as long, some 0.04 s earlier."""


def farthest(hand: str, seed: int, seconds: float, *, silent: bool) -> float:
    """While and after the sensors stand still, or are silent [m]."""
    robot_file = load_robot("ames")
    scene = SimulationOptions(hand=hand, seed=seed, led_noise_px=0.05, latency_s=(0.06, 0.09))
    flight = VirtualTimeSimulation(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), scene)
    flight.checks_rays = True
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
@pytest.mark.parametrize("held_s", [0.07, 0.15, 0.4])
@pytest.mark.parametrize("hand", ["moving", "filming"])
def test_sensors_that_stand_still_for_a_moment_are_a_gap(hand: str, held_s: float) -> None:
    for seed in (11, 12):
        held, silent = (farthest(hand, seed, held_s, silent=one) for one in (False, True))
        assert held < MOST_M + MOST_RATIO * silent
