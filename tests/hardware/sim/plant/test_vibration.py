"""A vibration is felt as it comes after sampling, and moves nothing."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.plant import Plant, PlantOptions
from hardware.sim.plant.vibration import Vibration

AMES = load_robot("ames").plant


def felt(vibration: Vibration | None, thrust: float, seconds: float = 4.0) -> np.ndarray:
    """(n, 6) samples at 200 Hz of a robot at rest or giving thrust."""
    options = PlantOptions(imu_noise=False, imu_steps=False, vibration=vibration)
    plant = Plant(AMES, np.random.default_rng(1), options)
    rows = []
    for _ in range(round(200 * seconds)):
        plant.step(np.full(8, thrust))
        rows.append(np.concatenate(plant.imu()))
    return np.array(rows)


@pytest.mark.parametrize("hz", [203.0, 197.0, 397.0])
def test_beside_a_multiple_of_the_sample_rate_it_comes_as_a_slow_motion(hz: float) -> None:
    shaken = felt(Vibration(hz, rate=0.1, force=2.0), 0.2) - felt(None, 0.2)
    spectrum = np.abs(np.fft.rfft(shaken[200:], axis=0)) / 300.0
    line = np.linalg.norm(spectrum[[round(3.0 * 3)]].reshape(2, 3), axis=1)
    np.testing.assert_allclose(line, (0.1, 2.0), rtol=0.01)
    assert np.linalg.norm(np.delete(spectrum, 9, axis=0)) < 0.01


def test_propellers_shake_while_they_turn_and_from_then_on() -> None:
    still = felt(None, 0.0)
    np.testing.assert_array_equal(felt(Vibration(203.0, force=2.0), 0.0), still)
    always = felt(Vibration(203.0, force=2.0, spins=False), 0.0) - still
    assert np.abs(always).max() > 1.0
    later = felt(Vibration(203.0, force=2.0, start_s=2.0), 0.2) - felt(None, 0.2)
    assert not later[:399].any()
    assert np.abs(later[400:]).max() > 1.0
