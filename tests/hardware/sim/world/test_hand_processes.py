"""Hands of linear processes that move as recorded ones did."""

import numpy as np
import pytest

from hardware.sim.measured_hands import BANDS_HZ, FORCE_BANDS_HZ, MEASURED, SPECTRA
from hardware.sim.world import sensors
from hardware.sim.world.hand_processes import band_rms, processes_of
from hardware.sim.world.random_motion import three_pole, tremor
from hardware.sim.world.world import GRID_S, World, WorldOptions
from pipeline.frames import GRAVITY
from tests.hardware.sim.test_measured_hands import band_rms as sampled_rms


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECTRA)
def test_a_random_hand_turns_as_fast_as_the_recorded_one_in_every_band(name):
    spectrum, world = SPECTRA[name], World(WorldOptions(seed=2, duration=30.0, hand=name))
    turning = np.rad2deg(world.omega_c)
    for band, wanted in zip(BANDS_HZ, spectrum.rates_deg_s, strict=True):
        assert sampled_rms(turning, GRID_S, band) == pytest.approx(wanted, rel=0.25, abs=0.2), band
    for band, wanted in zip(FORCE_BANDS_HZ, spectrum.forces, strict=True):
        rms = sampled_rms(world.hand[2, :, :3], GRID_S, band)
        assert rms == pytest.approx(wanted, rel=0.25), band


@pytest.mark.parametrize("process", [three_pole(), tremor(56.0, 0.15)])
def test_all_bands_together_are_the_whole_motion(process):
    bands = (0.0, 2.0), (2.0, 20.0), (20.0, 400.0)
    for order in (0, 1):
        whole = np.linalg.norm([band_rms(process, band, order) for band in bands])
        assert whole == pytest.approx(np.sqrt(process.stationary[order, order]), rel=0.01)


@pytest.mark.parametrize("name", MEASURED)
def test_each_hand_is_drawn_with_its_own_derivatives(name):
    world = World(WorldOptions(seed=3, duration=0.6, hand=name))
    for order in (0, 1):
        value, rate = world.hand[order : order + 2]
        gained = GRID_S * np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0)
        assert np.abs(value[1:] - value[0] - gained).max() < 2e-3 * 30**order
    assert len(processes_of(MEASURED[name])) == 6


def test_a_shaken_phone_says_no_more_than_2_g():
    world = World(WorldOptions(seed=3, duration=8.5, hand="shaken"))
    said = np.array([sample.a_m_cf_in_c for _, sample in sensors.phone_samples(world)])
    assert np.abs(world.f_c).max() > 2.2 * GRAVITY
    assert np.abs(said).max() == 2.0 * GRAVITY
