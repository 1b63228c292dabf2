"""Ages that vary from one picture or sample to the next cost no more than the oldest would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.simulation.figures import TrackingFigures, result_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

SECONDS = 14.0
MOST_LATE_TICKS = 4
"""Of 5 ms, that a sample of the body is late."""


class UnevenLink:
    """Holds each datagram back for another while."""

    def __init__(self, seed: int) -> None:
        self._rng, self._tick = np.random.default_rng(seed), 0
        self._held: list[tuple[int, bytes]] = []

    def __call__(self, data: bytes) -> Sequence[bytes]:
        self._tick += 1
        due = self._tick + int(self._rng.integers(0, MOST_LATE_TICKS + 1))
        self._held.append((due, data))
        out = [one for tick, one in self._held if tick <= self._tick]
        self._held = [(tick, one) for tick, one in self._held if tick > self._tick]
        return out


def flown(
    seed: int, ages_s: tuple[float, float], link: UnevenLink | None = None
) -> TrackingFigures:
    scene = SimulationOptions(hand="moving", seed=seed, led_noise_px=0.02, latency_s=ages_s)
    simulation = VirtualTimeSimulation(load_robot("ames"), TeleopConfig(), scene)
    if link is not None:
        simulation.follower.to_control = link
    return result_of(simulation.run(SECONDS), scene, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_pictures_of_20_to_220_ms_are_flown_by_as_those_of_220_ms_are(seed: int) -> None:
    """Each is fused when it was taken: how late it came then changes what it is worth, not where
    it says that the robot was."""
    old, uneven = flown(seed, (0.22, 0.22)), flown(seed, (0.02, 0.22))
    assert not old.ended
    assert not uneven.ended
    assert uneven.rms_mm < 1.05 * old.rms_mm
    assert uneven.chatter_n < 1.1 * old.chatter_n


@pytest.mark.slow
def test_samples_of_the_body_may_come_unevenly() -> None:
    even, uneven = flown(1, (0.06, 0.12)), flown(1, (0.06, 0.12), UnevenLink(5))
    assert not uneven.ended
    assert uneven.rms_mm < 1.05 * even.rms_mm
    assert uneven.rms_deg < 1.1 * even.rms_deg
