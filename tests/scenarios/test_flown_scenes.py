"""A robot with a body is led amid what stands and shines in rooms, as well as before a wall."""

from functools import cache

import pytest

from hardware.robot_file import load_robot
from hardware.sim.scenes.flown import FLOWN
from pipeline.config import TeleopConfig
from server.simulation.figures import TrackingFigures, result_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow


@cache
def flown(around: str, seed: int = 1) -> TrackingFigures:
    """Figures of eight seconds."""
    scene = SimulationOptions(hand="moving", seed=seed, around=FLOWN.get(around))
    trace = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene).run(8.0)
    return result_of(trace, scene, 0.0)


@pytest.mark.parametrize("around", ["typical", "bar", "twin", "near_bloom"])
def test_it_follows_as_before_an_empty_wall(around: str) -> None:
    """Which of two robots leads is told within a second."""
    bare, seen = flown(""), flown(around)
    assert seen.ended == ""
    assert seen.around == around
    assert seen.tracked_s > bare.tracked_s - 1.5
    assert seen.found_pct > (85.0 if around == "twin" else 97.0)
    assert seen.rms_mm < 1.25 * bare.rms_mm
