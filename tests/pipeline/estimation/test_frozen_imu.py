"""A sensor that stands still is told from one that is read more often than it measures."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.frozen_imu import FROZEN_S, FrozenImu
from pipeline.signals import BodyImu


@pytest.mark.parametrize("repeats", [1, 4, 10])
def test_samples_read_more_often_than_measured_are_taken(repeats: int) -> None:
    frozen = FrozenImu()
    for k in range(200):
        noise = np.full(3, 1e-3 * (k // repeats % 2))
        frozen.add(BodyImu(0.005 * k, noise, np.zeros(3)))
        assert not frozen.is_frozen


@pytest.mark.parametrize("number", range(6))
def test_one_number_that_changes_is_enough_and_none_is_not(number: int) -> None:
    frozen = FrozenImu()
    assert not frozen.is_frozen
    for k in range(100):
        six = np.zeros(6)
        six[number] = 1e-4 * (k if k < 50 else 50)
        frozen.add(BodyImu(0.005 * k, six[:3], six[3:]))
        assert frozen.is_frozen == (0.005 * (k - 50) >= FROZEN_S)
