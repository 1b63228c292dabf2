"""What the integrals learn while the thrusters can't give all that is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.control.pid import PoseError, Reference
from pipeline.control.tracking import Situation, Tracking
from pipeline.frames import GRAVITY, Array
from pipeline.signals import RelativeState, VirtualView

H, STILL, AHEAD = 0.005, np.zeros(3), np.array([2.5, 0.0, 0.0])
UP = np.array([0.0, 0.0, GRAVITY])
REFERENCE = Reference(AHEAD, np.eye(3))


def situation(a_cf_in_f: Array) -> Situation:
    """Phone and robot level, the robot where it should be, the phone accelerating."""
    relative = RelativeState(
        0.0, AHEAD, np.eye(3), STILL, STILL, STILL, np.eye(3), 0.0, 0.0, 0.0, UP + a_cf_in_f, UP
    )
    view = VirtualView(np.eye(3), STILL, AHEAD, np.eye(3), STILL, STILL)
    return Situation(relative, np.eye(3), view)


def learnt_n(hand: Array, off_m: float, most_n: float) -> tuple[float, float]:
    """Largest force along x that was missing, and the integral's in the end.

    Of thrusters that give `most_n`, while a hand accelerates (n,) along x.
    """
    tracking = Tracking(load_robot("ames").robot, TeleopConfig())
    tracking.start(None)
    error, most = PoseError(np.array([off_m, 0.0, 0.0]), STILL, STILL, STILL), 0.0
    for a in hand:
        now = situation(np.array([a, 0.0, 0.0]))
        wrench_in_b = tracking.wrench(now, REFERENCE, error, H)
        missing_in_b = wrench_in_b - np.clip(wrench_in_b, -most_n, most_n)
        tracking.learn(error, now.view, missing_in_b, H)
        most = max(most, abs(missing_in_b[0]))
    return most, float(tracking.constant_force_in_f[0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_hand_quicker_than_the_thrusters_does_not_move_the_integral(sign: float) -> None:
    hand = sign * np.concatenate((np.full(60, 4.0), np.full(60, -4.0)))
    missing_n, learnt = learnt_n(hand, 0.0, 4.0)
    assert missing_n > 3.0
    assert abs(learnt) < 0.02


def test_an_error_beyond_the_thrusters_does_whether_the_hand_starts_or_stops() -> None:
    far, still = 0.5, np.zeros(100)
    missing_n, given_way = learnt_n(still, far, 4.0)
    assert missing_n > 30.0
    assert given_way < -20.0
    for a in (4.0, -4.0):
        _, learnt = learnt_n(np.full(100, a), far, 4.0)
        assert learnt == pytest.approx(given_way, rel=0.25)
