"""The whole loop in virtual time: it tracks, and it does so twice alike."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.lockstep import Lockstep, Scene, Trace


def flight(seconds: float, seed: int = 5) -> Trace:
    scene = Scene(hand="steady", seed=seed, codec="jpeg")
    return Lockstep(load_robot("ames"), TeleopConfig(), scene).run(seconds)


def test_the_robot_keeps_its_pose_to_a_hand_that_tries_to_be_still() -> None:
    trace = flight(5.0)
    assert trace.left == ""
    assert trace.t[-1] - trace.t[0] > 2.0
    assert trace.poses > 0.9 * trace.pictures
    distances = np.linalg.norm(np.array(trace.error_in_f), axis=1)
    assert np.sqrt(np.mean(distances**2)) < 0.015


@pytest.mark.slow
def test_the_same_seed_flies_the_same_flight() -> None:
    first, second = flight(3.4), flight(3.4)
    assert len(first.t) > 20
    np.testing.assert_array_equal(np.array(first.thrusts), np.array(second.thrusts))
    np.testing.assert_array_equal(np.array(first.body_in_f), np.array(second.body_in_f))
