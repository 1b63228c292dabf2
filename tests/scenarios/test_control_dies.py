"""A control process dies in the middle of a fast motion: the robot brings itself down near by."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.signals import Mode
from server.experiments.gaps.flight import GapFlight

pytestmark = pytest.mark.slow
RESTLESS = (70, 71)
"""Hands that ask for all that the thrusters have, several times a second."""
FLIES_S, FALLS_S = (3.0, 3.25, 3.5, 3.75), 2.5
FARTHER_M = 0.15
"""Than in the flight before; the hazard table's bound."""


@pytest.mark.parametrize("flies_s", FLIES_S)
@pytest.mark.parametrize("seed", RESTLESS)
def test_a_robot_left_alone_at_full_thrust_does_not_go_far(seed: int, flies_s: float) -> None:
    robot_file = load_robot("ames")
    flight = GapFlight(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), seed)
    loop, tracks_s, flown, alone = flight.loop, 0.0, [], []
    given = np.zeros(1)
    while tracks_s < flies_s or given.max() < 0.9 * robot_file.robot.f_max:
        output = flight.advance()
        given = output.thrusts
        if output.failsafe.mode == Mode.TRACK:
            tracks_s += 0.005
            flown.append(np.linalg.norm(loop.follower.body.p_bf_in_f))
        assert loop.t < 20.0
    loop.control_every = 0
    for _ in range(round(FALLS_S / 0.005)):
        loop.advance()
        alone.append(np.linalg.norm(loop.follower.body.p_bf_in_f))
    assert loop.follower.body.thrusts.max() < 0.01, "a motor's lag behind zero"
    assert max(alone) - max(flown) < FARTHER_M
