"""A robot that hung at rest for long without a phone stays where it is in the next flight's gap.

Meanwhile its vertical goes on by its own gyroscope alone, and drifts: where it hangs without thrust
may not be learnt by that.
"""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from pipeline.config import PERIOD_S, TeleopConfig
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


def from_rest_m(flight: GapFlight) -> float:
    return float(np.linalg.norm(flight.loop.follower.body.p_bf_in_f))


def track(flight: GapFlight, seconds: float, within_s: float) -> float:
    """Go on until it has tracked for so long without a break; gives how far from rest it went."""
    end, tracked_s, farthest_m = flight.loop.t + within_s, 0.0, 0.0
    while tracked_s < seconds:
        is_tracking = flight.advance().failsafe.mode == Mode.TRACK
        tracked_s = tracked_s + PERIOD_S if is_tracking else 0.0
        farthest_m = max(farthest_m, from_rest_m(flight) * is_tracking)
        assert flight.loop.t < end
    return farthest_m


@pytest.mark.parametrize("seed", [1, 2])
def test_it_stays_in_a_gap_though_its_phone_was_away_before(seed: int) -> None:
    robot_file = load_robot("ames")
    flight = GapFlight(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), seed)
    begin, loop = flight.take_off(), flight.loop
    turning_slowly(flight)
    loop.transit.line = WebRtcLine(GapSchedule(AWAY_S, 1e6, begin))
    track(flight, FLIES_S, within_s=AWAY_S + 15.0)
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


ANOTHER_RAD_S, ANOTHER_M_S2 = 0.002, 0.05
"""Standard deviations of another phone's biases."""
LEARNT_RAD_S = float(np.deg2rad(0.5))
"""Of the robot's gyroscope, after a flight of three seconds and more."""


@pytest.mark.parametrize(("seed", "between_s"), [(3, 2.0), (5, 8.0)])
def test_it_stays_in_the_gaps_of_one_phone_after_another(seed: int, between_s: float) -> None:
    """Each by a gyroscope of its own: the robot's must not be taken for what it differs by."""
    robot_file, rng = load_robot("ames"), np.random.default_rng(seed)
    flight = GapFlight(robot_file, TeleopConfig(gains=robot_file.gains["phone"]), seed)
    flight.take_off()
    loop, strayed, learnt = flight.loop, [], []
    for n in range(5):
        farthest_m = track(flight, rng.uniform(3.0, 4.0), within_s=30.0)
        bias = loop.controller.teleop.estimator.health.bias_omega_b
        learnt.append(np.abs(bias - loop.follower.plant._imu._bias[:3]).max())
        vanishes = loop.t
        loop.transit.line = WebRtcLine(GapSchedule(between_s, 1e6, vanishes))
        while loop.t < vanishes + between_s - 1.0:
            flight.advance()
            strayed.append(from_rest_m(flight) - farthest_m)
        loop.phone.hand = make_hand("moving", seed=200 + n, start=robot_file.start, t_start=loop.t)
        loop.phone._bias_omega = rng.normal(0.0, ANOTHER_RAD_S, 3)
        loop.phone._bias_a = rng.normal(0.0, ANOTHER_M_S2, 3)
        loop.change_phone()
        while loop.t < vanishes + between_s:
            flight.advance()
    assert max(learnt) < LEARNT_RAD_S
    assert max(strayed) < STRAYS_M
