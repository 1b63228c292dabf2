"""Control dies in flight: the robot comes to zero by itself, upright, near to where it was."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.follower import FollowerState
from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import TeleopConfig
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow


def flown(name: str, seed: int, seconds: float) -> VirtualTimeSimulation:
    """A robot that is led, until control dies."""
    robot_file = load_robot(name, takes=COMMANDS)
    config = TeleopConfig(gains=robot_file.gains["phone"])
    loop = VirtualTimeSimulation(
        robot_file, config, SimulationOptions(hand="moving", seed=seed, led_noise_px=0.3)
    )
    loop.run(seconds)
    assert loop.trace.left == ""
    assert loop.trace.t
    return loop


@pytest.mark.parametrize(
    ("name", "seed", "seconds", "tilt_deg", "shift_m"),
    [
        ("quadrotor", 2, 9.4, 15.0, 0.5),
        ("quadrotor", 4, 10.8, 15.0, 0.5),
        ("copter", 2, 9.4, 15.0, 0.5),
        ("copter", 4, 10.8, 15.0, 0.5),
        ("ames", 0, 8.0, 9.0, 0.19),
    ],
)
def test_the_robot_stays_upright_and_near(
    name: str, seed: int, seconds: float, tilt_deg: float, shift_m: float
) -> None:
    loop = flown(name, seed, seconds)
    follower, states = loop.follower, []
    start = follower.plant.p_bf_in_f
    ramp_s = load_robot(name, takes=COMMANDS).robot.ramp_s
    while not states or states[-1] != FollowerState.REFUSING:
        follower.advance()
        plant = follower.plant
        states.append(follower._robot.end.state)
        assert np.degrees(np.arccos(min(1.0, plant.R_fb[2, 2]))) <= tilt_deg
        assert np.linalg.norm((plant.p_bf_in_f - start)[:2]) <= shift_m
    assert 0.060 <= 0.005 * states.index(FollowerState.COAST) <= 0.075
    assert 0.250 <= 0.005 * states.index(FollowerState.RAMP) <= 0.350
    assert len(states) * 0.005 == pytest.approx(0.060 + ramp_s, abs=0.011)
    follower.advance(0.2)
    assert float(np.abs(follower.plant.thrusts).max()) < 0.02
