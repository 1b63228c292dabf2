"""A simulated robot behind an autopilot of pymavlink follows a virtual phone, in virtual time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="NO PYMAVLINK: pip install pymavlink")

from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import TeleopConfig
from pipeline.estimation.estimators import warm_up
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from tests.hardware.link.mavlink.mavlink_rig import MavlinkFlight, mavlink_robot

pytestmark = pytest.mark.slow
SEED, SECONDS = 1012, 7.0
COPTER = Path(__file__).resolve().parents[4] / "examples" / "mavlink_copter" / "copter.toml"


def rms_mm(robot_file, flight):
    """Of a filming hand; it must reach the end."""
    scene = SimulationOptions(hand="filming", seed=SEED, led_noise_px=0.1, gains="phone")
    trace = VirtualTimeSimulation(robot_file, TeleopConfig(), scene, follower=flight).run(SECONDS)
    assert trace.left == ""
    assert len(trace.t) > 1000
    return 1e3 * float(np.sqrt((np.array(trace.error_in_f) ** 2).sum(axis=1).mean()))


def flown(robot_file, losses):
    """By our own link, then by MAVLink with those shares of datagrams lost."""
    warm_up()
    rms = [rms_mm(robot_file, None)]
    for loss in losses:
        flight = MavlinkFlight(robot_file, SEED, loss=loss)
        rms.append(rms_mm(robot_file, flight))
        flight.close()
    print([f"{one:.2f} mm" for one in rms])
    return rms


def test_it_follows_a_hand_as_by_our_own_link_with_two_of_a_hundred_datagrams_lost():
    ours, whole, lossy = flown(mavlink_robot(), (0.0, 0.02))
    assert whole < 1.1 * ours
    assert lossy < 1.2 * ours


def test_one_without_motion_sensors_follows_by_what_its_autopilot_says_of_its_motion():
    ours, lossy = flown(load_robot(COPTER, takes=COMMANDS), (0.02,))
    assert lossy < 1.2 * ours
