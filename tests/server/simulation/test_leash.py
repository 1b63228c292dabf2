"""Hands that lead beyond the reach, flown: thrusters keep a margin, the operator is told."""

from __future__ import annotations

import pytest

from pipeline.config import LeashConfig, TeleopConfig
from pipeline.signals import Mode
from tests.server.simulation.beyond_reach import MOST_AT_LIMIT_S, TOLD_S, beyond

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))]
)
def test_a_hand_beyond_reach_leaves_the_robot_at_the_border_with_thrust_to_spare(
    seed: int,
) -> None:
    flight = beyond(seed, TeleopConfig())
    assert flight.left == ""
    assert flight.modes == {Mode.TRACK}
    assert flight.at_f_max_s <= MOST_AT_LIMIT_S
    assert flight.told_late_s <= TOLD_S
    assert flight.back_mm < 20.0


def test_without_the_leash_the_same_hand_keeps_a_thruster_at_its_limit_and_is_told() -> None:
    flight = beyond(0, TeleopConfig(leash=LeashConfig(enabled=False)), stay_s=2.0)
    assert flight.at_f_max_s > MOST_AT_LIMIT_S
    assert flight.told_late_s <= TOLD_S
