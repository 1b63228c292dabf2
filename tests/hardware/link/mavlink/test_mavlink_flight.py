"""A simulated robot behind an autopilot of pymavlink follows a virtual phone, in virtual time."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="NO PYMAVLINK: pip install pymavlink")

from pipeline.config import TeleopConfig
from pipeline.estimation.estimators import warm_up
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from tests.hardware.link.mavlink.mavlink_rig import MavlinkFlight, mavlink_robot

pytestmark = pytest.mark.slow
SEED, SECONDS = 1012, 7.0


def rms_mm(flight):
    """Of a filming hand; it must reach the end."""
    scene = SimulationOptions(hand="filming", seed=SEED, led_noise_px=0.1, gains="phone")
    sim = VirtualTimeSimulation(mavlink_robot(), TeleopConfig(), scene, follower=flight)
    trace = sim.run(SECONDS)
    assert trace.left == ""
    assert len(trace.t) > 1000
    return 1e3 * float(np.sqrt((np.array(trace.error_in_f) ** 2).sum(axis=1).mean()))


def test_it_follows_a_hand_as_by_our_own_link_with_two_of_a_hundred_datagrams_lost():
    warm_up()
    flown = {"our link": rms_mm(None)}
    for loss in (0.0, 0.02):
        flight = MavlinkFlight(mavlink_robot(), SEED, loss=loss)
        flown[f"MAVLink, {loss:.0%} lost"] = rms_mm(flight)
        flight.close()
    print({name: f"{rms:.2f} mm" for name, rms in flown.items()})
    assert flown["MAVLink, 0% lost"] < 1.1 * flown["our link"]
    assert flown["MAVLink, 2% lost"] < 1.2 * flown["our link"]
