"""Hands of sines that move as recorded ones did, and what people do with a phone besides."""

import numpy as np
import pytest

from hardware.sim.hand import REST_S, make_hand
from hardware.sim.hand_parts import FADE_S
from hardware.sim.measured_hands import BANDS_HZ, FORCE_BANDS_HZ, SPECTRA
from pipeline.frames import GRAVITY

PERIOD_S = 0.008
MOVES_S = REST_S + FADE_S


def band_rms(samples, period_s, band):
    """RMS length of (n, 3) between two frequencies [Hz]."""
    window = np.hanning(len(samples))
    power = np.abs(np.fft.rfft(window[:, None] * samples, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(samples), period_s)
    chosen = (frequency >= band[0]) & (frequency < band[1])
    return np.sqrt(2.0 * power[chosen].sum() / np.square(window).sum() / len(samples))


def readings(kind, seconds, start=MOVES_S, seed=1):
    """(rates [°/s], forces less gravity [m/s²]) of a hand."""
    hand = make_hand(kind, seed=seed)
    times = np.arange(start, start + seconds, PERIOD_S).tolist()
    rates = np.rad2deg([hand.omega_in_c(t) for t in times])
    forces = [hand.pose(t)[0] @ hand.specific_force_in_c(t) for t in times]
    return rates, np.array(forces) - (0.0, 0.0, GRAVITY)


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECTRA)
def test_a_hand_of_sines_turns_as_fast_as_the_recorded_one_in_every_band(name):
    spectrum, (rates, forces) = SPECTRA[name], readings(name, 30.0)
    for band, wanted in zip(BANDS_HZ, spectrum.rates_deg_s, strict=True):
        assert band_rms(rates, PERIOD_S, band) == pytest.approx(wanted, rel=0.2, abs=0.1), band
    for band, wanted in zip(FORCE_BANDS_HZ, spectrum.forces, strict=True):
        assert band_rms(forces, PERIOD_S, band) == pytest.approx(wanted, rel=0.2), band


@pytest.mark.slow
def test_no_hand_knows_its_phase_a_second_later():
    rates, _ = readings("quiet", 20.0)
    for later_s in (0.9, 1.1, 1.7, 2.3):
        k = round(later_s / PERIOD_S)
        alike = (rates[k:] * rates[:-k]).sum() / np.square(rates).sum()
        assert abs(alike) < 0.3, later_s


@pytest.mark.slow
def test_a_walking_hand_goes_up_and_down_twice_a_second():
    up = [readings("walking", 12.0, seed=seed)[1][:, 2:] for seed in range(4)]
    steps = np.array([band_rms(u, PERIOD_S, (1.7, 2.3)) for u in up])
    assert np.sqrt(np.square(steps).mean()) == pytest.approx(2.0 / np.sqrt(2.0), rel=0.3)
    assert max(band_rms(u, PERIOD_S, (2.5, 12.0)) for u in up) < 0.4


def test_a_phone_that_was_put_down_lies_still_until_it_is_picked_up():
    hand = make_hand("put_down", seed=2)
    lying = [hand.omega_in_c(t) for t in np.arange(REST_S + 6.5, REST_S + 10.0, 0.1)]
    assert np.abs(lying).max() == 0.0
    assert hand.pose(REST_S + 8.0)[1] == pytest.approx(hand.pose(0.0)[1] - (0.0, 0.0, 0.1))
    again = [hand.omega_in_c(t) for t in np.arange(REST_S + 10.5, REST_S + 11.0, 0.05)]
    assert np.abs(again).max() > 0.01


def test_a_shaken_phone_feels_more_than_2_g():
    hand = make_hand("shaken", seed=2)
    forces = [hand.specific_force_in_c(t) for t in np.arange(REST_S + 6.5, REST_S + 7.5, 0.01)]
    assert np.abs(forces)[:, 1].max() > 2.2 * GRAVITY


@pytest.mark.slow
@pytest.mark.parametrize("hz", [6.0, 11.0, 13.0])
def test_a_strong_tremor_is_a_narrow_band(hz):
    """0.09° RMS of each axis."""
    rates, _ = readings(f"trembling_{hz:.0f}_hz", 15.0)
    expected = 0.09 * 2.0 * np.pi * hz * np.sqrt(3.0)
    assert band_rms(rates, PERIOD_S, (hz - 1.5, hz + 1.5)) == pytest.approx(expected, rel=0.35)
