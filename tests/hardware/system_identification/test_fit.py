"""A plant's numbers come out of its flights, and what did not move it tells nothing."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.plant import PlantOptions
from hardware.system_identification.fit import IdentificationError, identify
from hardware.system_identification.plant_model import SpecificPlant
from tests.hardware.system_identification.exciting import LINK_S, shaken

KNOWN = load_robot("ames").plant
GAINS = np.array((0.9, 1.1, 1.05, 0.93, 1.0, 1.12, 0.88, 0.97))
REAL = replace(KNOWN, mass=2.7, inertia=KNOWN.inertia * (1.3, 0.8, 0.9), lag=0.036, delay=0.011)
QUIET = PlantOptions(imu_noise=False, imu_bias=False, imu_steps=False)


def true_of(parameters, gains):
    """As it is to be found."""
    plant = SpecificPlant.of(parameters, LINK_S)
    return replace(plant, thrust=plant.thrust * gains)


@cache
def identified(*seeds):
    """From a flight of each seed."""
    return identify(KNOWN, [shaken(REAL, GAINS, seed=seed) for seed in seeds])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_what_a_robot_is_comes_out_of_how_it_moves(seed):
    found = identified(seed)
    true = true_of(REAL, GAINS)
    np.testing.assert_allclose(found.plant.thrust, true.thrust, rtol=0.015)
    np.testing.assert_allclose(found.plant.inertia, true.inertia, rtol=0.015)
    assert found.plant.lag == pytest.approx(true.lag, rel=0.01)
    assert found.plant.delay == pytest.approx(true.delay, abs=4e-4)
    assert found.plant.sideways == pytest.approx(true.sideways, rel=0.03)
    assert found.plant.along == pytest.approx(true.along, rel=0.03)
    assert found.plant.hook == pytest.approx(true.hook, rel=0.03)
    assert found.explained.min() > 0.98


@pytest.mark.slow
def test_two_flights_tell_more_than_one():
    one, both = identified(1), identified(1, 2)
    assert both.seconds == pytest.approx(2.0 * one.seconds, rel=0.01)
    assert np.trace(both.covariance[:8, :8]) < np.trace(one.covariance[:8, :8])


@pytest.mark.slow
def test_a_moment_about_which_nothing_turned_is_uncertain():
    still = identify(KNOWN, [shaken(REAL, GAINS, seed=1, axes=(0, 1, 2))])
    turned = identified(1)
    yaw = len(GAINS) + 4
    assert still.covariance[yaw, yaw] > 9.0 * turned.covariance[yaw, yaw]


@pytest.mark.slow
def test_a_thruster_that_pushes_the_wrong_way_has_a_negative_share():
    signs = np.ones(8)
    signs[3] = -1.0
    directions = KNOWN.thruster_directions_in_b * signs[:, None]
    built = replace(KNOWN, thruster_directions_in_b=directions)
    found = identify(KNOWN, [shaken(KNOWN, seed=6, built=built)])
    shares = found.plant.thrust / np.abs(found.plant.thrust).mean()
    assert shares[3] < -0.8
    assert np.delete(shares, 3).min() > 0.8


@pytest.mark.slow
def test_commands_of_older_recordings_are_enough_for_five_percent():
    found = identify(KNOWN, [shaken(REAL, GAINS, seed=7, every=4)])
    assert found.plant.thrust.mean() == pytest.approx(GAINS.mean() / REAL.mass, rel=0.05)


@pytest.mark.slow
def test_without_noise_only_what_small_motions_leave_out_is_left():
    found = identify(KNOWN, [shaken(REAL, GAINS, seed=8, options=QUIET)])
    np.testing.assert_allclose(found.plant.thrust, true_of(REAL, GAINS).thrust, rtol=0.015)


def test_short_flights_are_refused_in_words():
    with pytest.raises(IdentificationError, match="lasted 8 s: fly for 12 s"):
        identify(KNOWN, [shaken(KNOWN, seconds=8.0)])
    with pytest.raises(IdentificationError, match="lasted 0 s"):
        identify(KNOWN, [])


def test_commands_for_another_robot_are_refused_in_words():
    quadrotor = load_robot("quadrotor").plant
    with pytest.raises(IdentificationError, match="for 8 thrusters: the file has 4"):
        identify(quadrotor, [shaken(KNOWN, seconds=2.0)])
