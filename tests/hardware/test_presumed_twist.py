"""How a robot is presumed to move: by what it was told, and by what it measures of that later."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.plant_parameters import NO_SENSORS, OdometryParameters
from hardware.presumed_twist import PresumedTwist
from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.plant.odometry import Odometry
from hardware.sim.plant.twist_plant import TwistPlant

DRIVE = load_robot("rover", takes=COMMANDS).robot.twist
FORWARD = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.4])
PERIOD_S = 0.005


def told(t):
    return np.sin(3.0 * t) * FORWARD


def misses(plant, measure=lambda _t, _twist: None):
    """By how much it is missed (n, 6) from half a second on."""
    presumed, rows = PresumedTwist(DRIVE), []
    for k in range(400):
        t = PERIOD_S * k
        presumed.tell(told(t), t)
        plant.step(told(t))
        measured = measure(t + PERIOD_S, plant.given)
        if measured is not None:
            presumed.measured(*measured)
        rows.append(presumed.at(t + PERIOD_S) - plant.twist_in_b)
    return np.array(rows[100:])


def plant_of(drive=DRIVE, slip=0.0):
    return TwistPlant(drive, NO_SENSORS, np.random.default_rng(1), slip=slip)


def rms(rows):
    return float(np.sqrt((rows**2).sum(axis=1).mean()))


def test_a_robot_as_its_file_has_it_moves_as_presumed():
    assert rms(misses(plant_of())) < 0.002


def test_its_rate_is_that_of_its_twist():
    presumed = PresumedTwist(DRIVE)
    for k in range(100):
        presumed.tell(told(PERIOD_S * k), PERIOD_S * k)
    before, rate = presumed.at(0.5), presumed.rate
    assert presumed.at(0.501) - before == pytest.approx(0.001 * rate, abs=1e-4)


def test_what_is_measured_late_and_seldom_takes_off_what_another_lag_makes():
    drive = replace(DRIVE, lag_s=0.12)
    exact = OdometryParameters(0.05, 0.03, 0.0, 0.0)
    odometry = Odometry(exact, np.ones(6, dtype=bool), np.random.default_rng(2))

    def measured(t, twist):
        said, age_s = odometry.read(round(1e6 * t), twist)
        return said, t - age_s

    unmeasured = rms(misses(plant_of(drive)))
    assert unmeasured > 0.03
    assert rms(misses(plant_of(drive), measured)) < 0.4 * unmeasured


def test_odometry_is_as_seldom_as_late_and_as_noisy_as_it_says():
    parameters = OdometryParameters(0.05, 0.03, 0.02, 0.01)
    axes = np.array([True, True, False, False, False, True])
    odometry = Odometry(parameters, axes, np.random.default_rng(3))
    told_rows, ages = [], []
    for k in range(1, 40001):
        twist, age_s = odometry.read(5000 * k, FORWARD)
        if k > 100:
            told_rows.append(twist)
            ages.append(age_s)
    rows = np.array(told_rows)
    assert len(np.unique(rows[:, 0])) == pytest.approx(len(rows) / 10, abs=1)
    assert 0.029 < min(ages) < max(ages) < 0.081
    scatter = np.std(rows, axis=0)
    assert scatter[[0, 1, 5]] == pytest.approx([0.02, 0.02, 0.01], rel=0.1)
    assert not scatter[2:5].any()


def test_a_body_that_slips_goes_otherwise_than_its_wheels():
    plant, shares = plant_of(slip=0.1), []
    for _ in range(20000):
        plant.step(FORWARD)
        shares.append(1.0 - plant.twist_in_b[0] / plant.given[0] if plant.given[0] else 0.0)
    assert np.std(shares[1000:]) == pytest.approx(0.1, rel=0.35)


@pytest.mark.parametrize("spin", [False, True])
def test_against_a_wall_the_body_stands_and_the_wheels_stand_or_spin(spin):
    plant = plant_of()
    for _ in range(200):
        plant.step(FORWARD)
    plant.is_blocked, plant.wheels_spin = True, spin
    place = plant.p_bf_in_f
    for _ in range(200):
        plant.step(FORWARD)
    assert np.linalg.norm(plant.p_bf_in_f - place) < 1e-3
    assert np.allclose(plant.given, FORWARD if spin else 0.0, atol=1e-6)
    plant.is_blocked = False
    for _ in range(200):
        plant.step(FORWARD)
    assert np.allclose(plant.twist_in_b, FORWARD, atol=1e-6)
