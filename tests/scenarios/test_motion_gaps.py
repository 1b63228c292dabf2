"""After a gap of the phone's motion sensors gravity is where it was, however the hand moves then.

The hand is shoved while the phone's line is dark, and accelerates or brakes by 2.7 m/s² as it comes
back: one sample of the phone's accelerometer is then 0.27 rad beside gravity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import MovingHand
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.signals import Mode
from server.experiments.gaps.flight import GapFlight
from server.experiments.gaps.schedule import GapSchedule, WebRtcLine

pytestmark = pytest.mark.slow
SHOVE = np.array([1.5, 2.0, 1.0, 1.0, -1.5, 1.0])
"""At its peak [m/s², rad/s²]."""
LASTS_S = 0.8


@dataclass(frozen=True, slots=True)
class Shove:
    """Accelerates along a period of a sine, and so moves on and turns a little."""

    begin: float

    def at(self, t: float) -> Array:
        w, t = 2.0 * np.pi / LASTS_S, min(max(t - self.begin, 0.0), LASTS_S)
        s, c = np.sin(w * t), np.cos(w * t)
        return np.outer((t / w - s / w**2, (1.0 - c) / w, s), SHOVE)


@pytest.mark.parametrize("gap_s", [0.25, 0.5, 0.9])
@pytest.mark.parametrize("phase", [0.25, 0.75], ids=["accelerating", "braking"])
@pytest.mark.parametrize("name", ["quadrotor", "ames"])
def test_gravity_stays_where_it_was(name: str, gap_s: float, phase: float) -> None:
    robot_file = load_robot(name)
    flight = GapFlight(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), seed=1)
    begin = flight.take_off() + 0.1
    loop, back = flight.loop, begin + gap_s
    hand = loop.phone.hand
    assert isinstance(hand, MovingHand)
    hand._parts += (Shove(back - phase * LASTS_S - hand._t_moves),)
    loop.transit.line = WebRtcLine(GapSchedule(gap_s, 1e6, begin))
    modes, told = set(), []
    while loop.t < back + 0.35:
        output = flight.advance()
        modes.add(output.failsafe.mode)
        (R_fc, _), (R_fb, _) = loop.truth()
        assert output.relative is not None
        assert output.R_fc is not None
        up_in_b = output.R_fc[2] @ output.relative.R_cb
        assert np.linalg.norm(up_in_b - R_fb[2]) < 0.025  # what a flyer's thrust is turned by
        told.append((output.R_fc[2], R_fc[2]))
    assert Mode.COAST in modes
    found, true = np.array(told[-20:]).swapaxes(0, 1)
    assert np.linalg.norm(found - true, axis=1).max() < 0.025
