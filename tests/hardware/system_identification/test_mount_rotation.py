"""Sensors that sit a little beside, and one slow thruster, are found to a fraction of a degree."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.built import AsBuilt
from hardware.system_identification.fit import LINK_S, identify_sampled
from hardware.system_identification.flight_record import SampledFlight
from hardware.system_identification.imu_attitude import attitude_by_imu
from hardware.system_identification.mount_rotation import mount_rotation, thruster_lags
from hardware.system_identification.plant_model import SpecificPlant
from hardware.system_identification.thruster_sorting import spans
from tests.hardware.system_identification.pulses import pulsed

KNOWN = load_robot("ames").plant
OFF_DEG = (1.0, -2.0, 2.5)
pytestmark = pytest.mark.slow


@cache
def brought():
    """A flight of pulses by sensors that sit beside, and the plant that explains it."""
    built = AsBuilt.model_validate({"imu_off_deg": list(OFF_DEG), "lag_s": 0.036})
    commands, omega, force, _ = pulsed(built.plant(KNOWN), 0.3, built.options())
    seen = attitude_by_imu(omega, force, KNOWN.imu)
    flight = SampledFlight(commands, seen.omega_in_s, seen.force_in_s, seen.R_fs)
    return flight, identify_sampled(KNOWN, [flight], SpecificPlant.of(KNOWN, LINK_S))


def test_how_far_sensors_sit_beside():
    flight, found = brought()
    off, covariance = mount_rotation(KNOWN, flight, found)
    np.testing.assert_allclose(np.degrees(off), np.negative(OFF_DEG), atol=0.25)
    assert np.degrees(np.sqrt(np.diag(covariance))).max() < 0.25


def test_the_lag_of_each_thruster():
    flight, found = brought()
    lags = thruster_lags(KNOWN, flight, found, spans(flight.commands))
    assert len(lags) == 8
    for lag in lags:
        assert lag is not None
        assert lag[0] == pytest.approx(0.036, abs=0.0015)
        assert lag[1] < 0.002
