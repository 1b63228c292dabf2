"""A robot that hung at rest for long without a phone stays where it is in the next flight's gap.

Meanwhile its vertical goes on by its own gyroscope alone, and drifts: where it hangs without thrust
may not be learnt by that.
"""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.signals import Mode
from server.experiments.gaps.flight import GapFlight
from server.experiments.gaps.schedule import GapSchedule, WebRtcLine

pytestmark = pytest.mark.slow
AWAY_S, FLIES_S, COASTS_S = 15.0, 4.0, 0.9
DRIFTS_RAD_S = float(np.deg2rad(2.0))
"""A third of it was seen after flights of some seconds on a busy machine."""
STRAYS_M = 0.04


def turning_slowly(flight: GapFlight) -> None:
    """Let the robot's gyroscope drift from now on."""
    plant = flight.loop.follower.plant
    honest = plant.imu

    def imu() -> tuple[Array, Array]:
        omega, a = honest()
        return omega + np.array([DRIFTS_RAD_S, 0.0, 0.0]), a

    plant.imu = imu


@pytest.mark.parametrize("seed", [1, 2])
def test_it_stays_in_a_gap_though_its_phone_was_away_before(seed: int) -> None:
    robot_file = load_robot("ames")
    flight = GapFlight(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), seed)
    begin, loop = flight.take_off(), flight.loop
    turning_slowly(flight)
    loop.transit.line = WebRtcLine(GapSchedule(AWAY_S, 1e6, begin))
    tracked_s = 0.0
    while tracked_s < FLIES_S:
        mode = flight.advance().failsafe.mode
        tracked_s = tracked_s + 0.005 if mode == Mode.TRACK else 0.0
        assert loop.t < begin + AWAY_S + 15.0
    vanishes = loop.t
    assert vanishes > begin + AWAY_S + FLIES_S
    loop.transit.line = WebRtcLine(GapSchedule(AWAY_S, 1e6, vanishes))
    strayed = []
    while loop.t < vanishes + COASTS_S:
        if flight.advance().failsafe.mode == Mode.COAST:
            away_in_f = loop.follower.plant.p_bf_in_f - flight.due_in_f
            strayed.append(float(np.linalg.norm(away_in_f)))
    assert len(strayed) > 100
    assert max(strayed) < STRAYS_M
