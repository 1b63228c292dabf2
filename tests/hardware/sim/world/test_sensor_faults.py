"""What is wrong with a sensor is what is asked for, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.world import sensors
from hardware.sim.world.pcrb import bound, rms
from hardware.sim.world.sensor_faults import TWIN_S, ImuFault
from hardware.sim.world.world import World, WorldOptions
from pipeline.signals import PhoneImu

SETUP = WorldOptions(seed=4, duration=3.0)


def body(setup):
    samples = [s for _, s in sensors.body_samples(World(setup))]
    t = np.array([s.t for s in samples])
    return t, *(
        np.array([getattr(s, n) for s in samples]) for n in ("omega_m_bf_in_b", "a_m_bf_in_b")
    )


def added(**fault):
    """(t, (n, 3) [rad/s], (n, 3) [m/s²]) by which the robot's samples differ with a fault."""
    t, omega, f = body(SETUP)
    _, omega_too, f_too = body(replace(SETUP, body_fault=ImuFault(**fault)))
    return t, omega_too - omega, f_too - f


def test_biases_step_once_by_as_much_as_is_said():
    t, omega, f = added(step=(0.2, 1.0), start=1.0, stop=2.0)
    during = (t >= 1.0) & (t < 2.0)
    for change, size in ((omega, 0.2), (f, 1.0)):
        assert np.abs(change[~during]).max() < 1e-12
        assert np.linalg.norm(change[during], axis=1) == pytest.approx(size)
        assert np.ptp(change[during], axis=0).max() < 1e-12


def test_a_tone_beside_the_sample_rate_is_felt_as_a_slow_one():
    _, omega, f = added(tone=(0.0, 1.0), tone_hz=200.5, start=0.0)
    assert np.abs(omega).max() < 1e-12
    along = f @ np.linalg.svd(f)[2][0]
    assert np.ptp(along) == pytest.approx(2.0, rel=0.01)
    assert np.abs(np.diff(along)).max() < 1.1 * 2.0 * np.pi * 0.5 * 0.005


def test_noise_is_so_many_times_greater():
    _, omega, f = added(noise=11.0)
    assert omega.std() == pytest.approx(10.0 * sensors.BODY_NOISE[0], rel=0.1)
    assert f.std() == pytest.approx(10.0 * sensors.BODY_NOISE[1], rel=0.1)


def test_a_hole_has_no_samples_and_twins_come_right_after_their_like():
    fault = ImuFault(holes=(1.0,), twins=0.3)
    stamps = np.sort(
        [s.t for _, s in sensors.phone_samples(World(replace(SETUP, phone_fault=fault)))]
    )
    apart = np.diff(stamps)
    assert fault.hole_s < apart.max() < fault.hole_s + 2.0 / 60.0
    assert 0.2 < (apart < 2.0 * TWIN_S).sum() / len(stamps) < 0.3


def test_leds_scatter_more_than_is_said_of_them():
    told = [
        [s.rays.tangents for _, s in sensors.pictures(World(replace(SETUP, pixel_noise=times)))]
        for times in (0.0, 1.0, 2.5)
    ]
    one, more = (np.array(told[k]) - np.array(told[0]) for k in (1, 2))
    assert more == pytest.approx(2.5 * one)
    (_, seen), *_ = sensors.pictures(World(replace(SETUP, pixel_noise=2.5)))
    assert seen.rays.covariances[0, 0, 0] == pytest.approx((sensors.NOISE_PX / 900.0) ** 2)


@pytest.mark.slow
def test_nobody_knows_as_much_by_worse_sensors():
    usual, body, pixels = (
        rms(bound(World(setup), every=0.5, start=1.5).now)[0]
        for setup in (
            SETUP,
            replace(SETUP, body_fault=ImuFault(noise=20.0)),
            replace(SETUP, pixel_noise=2.5),
        )
    )
    assert body > 1.1 * usual
    assert pixels > 1.3 * usual


def test_the_phone_says_nothing_else_for_a_fault_of_the_robot():
    for fault in (ImuFault(noise=5.0), ImuFault(step=(0.2, 0.0), start=0.0)):
        there, usual = (
            [s for _, s in sensors.phone_samples(World(setup))]
            for setup in (replace(SETUP, body_fault=fault), SETUP)
        )
        assert all(isinstance(s, PhoneImu) for s in there)
        assert all(
            np.array_equal(a.a_m_cf_in_c, b.a_m_cf_in_c) for a, b in zip(there, usual, strict=True)
        )
