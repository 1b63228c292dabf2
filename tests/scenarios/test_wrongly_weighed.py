"""A robot that weighs, hangs and answers otherwise than its file says is pushed by nobody."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hardware.robot_file import load_robot
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.config import LeashConfig, TeleopConfig
from server.simulation.figures import result_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow
AMES = load_robot("ames")
FLIES_S = 14.0


def rms_mm(seed: int, mass: float, lag: float, stiffness: float, leash: LeashConfig) -> float:
    """Of a robot that has so many times its file's, led by somebody who walks."""
    told = AMES.plant
    assert told.suspension is not None
    suspension = replace(told.suspension, stiffness=stiffness * told.suspension.stiffness)
    plant = replace(told, mass=mass * told.mass, lag=lag * told.lag, suspension=suspension)
    scene = SimulationOptions(hand="walking", seed=seed, led_noise_px=0.02)
    follower = VirtualTimeFollower(replace(AMES, plant=plant), seed)
    config = TeleopConfig(gains=AMES.gains["phone"], leash=leash)
    flown = result_of(
        VirtualTimeSimulation(AMES, config, scene, follower=follower).run(FLIES_S), scene, 0.0
    )
    assert flown.ended == ""
    return flown.rms_mm


@pytest.mark.parametrize(
    ("seed", "mass", "lag", "stiffness"),
    [(3, 0.85, 1.32, 1.16), (11, 0.83, 0.74, 0.96), (19, 0.88, 1.04, 1.18), (27, 0.80, 0.71, 0.82)],
)
def test_what_its_file_says_wrongly_is_taken_for_no_push_by_which_the_leash_would_move_it(
    seed: int, mass: float, lag: float, stiffness: float
) -> None:
    held, free = (
        rms_mm(seed, mass, lag, stiffness, LeashConfig(enabled=enabled))
        for enabled in (True, False)
    )
    assert held < 1.25 * free
