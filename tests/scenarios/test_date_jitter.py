"""Pictures each of which is dated a little wrongly: nothing is doubted but their dates."""

import pytest

from hardware.robot_file import load_robot
from hardware.sim.phone import PhoneOptions
from pipeline.config import TeleopConfig
from server.simulation.figures import TrackingFigures, result_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow


def flown(jitter_s: float, seed: int) -> TrackingFigures:
    """Figures of a flight by LEDs' rays, which the picture check believes or not."""
    sensors = PhoneOptions(date_jitter_s=jitter_s)
    scene = SimulationOptions(hand="moving", seed=seed, led_noise_px=0.1, sensors=sensors)
    flight = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene)
    flight.checks_rays = True
    return result_of(flight.run(16.0), scene, 0.0)


@pytest.mark.parametrize(
    ("jitter_s", "seed", "most_mm"), [(0.004, 1, 7.0), (0.008, 1, 8.5), (0.008, 2, 10.0)]
)
def test_a_moving_hand_is_followed(jitter_s: float, seed: int, most_mm: float) -> None:
    """32 mm of the first and 50 of the second before, thrusters at their limits; 4.0 and 7.1 of
    right dates."""
    figures = flown(jitter_s, seed)
    assert figures.ended == ""
    assert figures.rms_mm < most_mm
    assert figures.saturated_pct < 1.0
    assert figures.found_pct > 98.0
