"""Hold: takes over without a jump, lets the force go, keeps the attitude."""

from __future__ import annotations

import numpy as np

from pipeline.config import HoldConfig
from pipeline.frames import exp
from pipeline.hold import Hold

CONFIG = HoldConfig()


def test_takes_over_the_force_and_lets_it_go() -> None:
    hold, force = Hold(CONFIG), np.array([1.0, -2.0, 3.0])
    hold.start(force, exp(np.array([0.1, 0.2, 0.3])))
    first = hold.wrench(np.zeros(3), 1e-6)
    np.testing.assert_allclose(first[:3], force, atol=1e-4)
    for _ in range(int(CONFIG.bleed_s / 0.005)):
        last = hold.wrench(np.zeros(3), 0.005)
    np.testing.assert_allclose(last[:3], force / np.e, rtol=1e-3)


def test_a_body_that_turns_is_turned_back_and_keeps_the_force_in_f() -> None:
    hold, R_fb = Hold(CONFIG), exp(np.array([0.0, 0.0, 0.5]))
    hold.start(np.array([2.0, 0.0, 0.0]), R_fb)
    omega = np.array([0.0, 0.0, 1.0])
    for _ in range(20):
        wrench = hold.wrench(omega, 0.005)
    assert wrench[5] < -CONFIG.Kp * 0.09 - CONFIG.Kd * 0.99
    R_fb_now = R_fb @ exp(omega * 0.1)
    in_f = R_fb_now @ wrench[:3]
    direction = in_f / np.linalg.norm(in_f)
    np.testing.assert_allclose(direction, R_fb @ np.array([1.0, 0.0, 0.0]), atol=1e-9)
