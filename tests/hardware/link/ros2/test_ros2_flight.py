"""A simulated base behind real DDS follows a virtual phone as by our own link, in virtual time."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="NO CYCLONE DDS: pip install 'lightleash[ros2]'")

from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import TeleopConfig
from pipeline.estimation.estimators import warm_up
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from tests.hardware.link.ros2.ros2_rig import Ros2Flight, ros2_robot

pytestmark = pytest.mark.slow
TWISTER = load_robot("twister", takes=COMMANDS)
SEED, SECONDS = 1012, 7.0


def rms_mm(flight):
    """Of a filming hand; it must reach the end."""
    scene = SimulationOptions(hand="filming", seed=SEED, led_noise_px=0.1, gains="phone")
    trace = VirtualTimeSimulation(TWISTER, TeleopConfig(), scene, follower=flight).run(SECONDS)
    assert trace.left == ""
    assert len(trace.t) > 1000
    return 1e3 * float(np.sqrt((np.array(trace.error_in_f) ** 2).sum(axis=1).mean()))


def test_it_follows_a_hand_as_by_our_own_link_and_almost_as_well_without_odometry():
    warm_up()
    flown = {"our link": rms_mm(None)}
    for name, odometry in (("ROS 2", "odom"), ("without odometry", None)):
        flight = Ros2Flight(ros2_robot(odometry=odometry), SEED, odometry=odometry is not None)
        flown[name] = rms_mm(flight)
        flight.close()
    print({name: f"{rms:.2f} mm" for name, rms in flown.items()})
    assert flown["ROS 2"] < 1.1 * flown["our link"]
    assert flown["without odometry"] < 1.5 * flown["our link"]
