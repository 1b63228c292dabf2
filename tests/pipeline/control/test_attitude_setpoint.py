"""A force and a yaw torque as roll, pitch, yaw rate and thrust."""

from dataclasses import replace
from math import atan2, hypot, radians

import numpy as np
import pytest

from hardware.dynamics import dynamics_of
from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import MarginsConfig
from pipeline.control.attitude_setpoint import MOST_RATE, MOST_TRIM, AttitudeSetPoint, LeanModel
from pipeline.control.margins import Loop, Sensing, axis_margins
from pipeline.estimator_config import NoFilterConfig
from pipeline.frames import GRAVITY, R_from_rpy, exp

COPTER = load_robot("copter", takes=COMMANDS).robot
DRIVE, WEIGHT, H = COPTER.attitude, COPTER.weight_to_carry, 0.005
HOVERS = np.array([0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])
STILL = np.zeros(3)


def settled(force_in_f, R_fb, seconds=0.1):
    """What is told for a force that stays, to a body whose lean is as told before."""
    set_point = AttitudeSetPoint(DRIVE, COPTER)
    for _ in range(round(seconds / H)):
        told = set_point.of(force_in_f, np.zeros(6), R_fb, STILL, H)
    return told


@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.0])
@pytest.mark.parametrize("lean", [(0.05, -0.1), (0.0, 0.2), (-0.15, 0.0)])
def test_told_so_its_z_axis_points_along_the_force_whatever_its_heading(yaw, lean):
    force_in_f = 12.0 * R_from_rpy(np.array([*lean, yaw]))[:, 2]
    roll, pitch, yaw_rate, _ = settled(force_in_f, exp(np.array([0.0, 0.0, yaw])))
    assert (roll, pitch) == pytest.approx(lean, abs=1e-3)
    assert yaw_rate == 0.0


def test_forward_is_nose_down_and_left_is_leaning_left():
    roll, pitch, *_ = settled(np.array([1.0, 0.0, WEIGHT]), np.eye(3))
    assert (roll, pitch) == pytest.approx((0.0, atan2(1.0, WEIGHT)), abs=1e-3)
    roll, pitch, *_ = settled(np.array([0.0, 1.0, WEIGHT]), np.eye(3))
    assert (roll, pitch) == pytest.approx((-atan2(1.0, WEIGHT), 0.0), abs=1e-3)


def test_the_thrust_is_passed_on():
    told = AttitudeSetPoint(DRIVE, COPTER).of(HOVERS[:3], HOVERS, np.eye(3), STILL, H)
    assert told[3] == WEIGHT


def test_a_robot_that_follows_rates_turns_as_the_torque_would_turn_it():
    """T ω̇ = ω_told − ω, from whatever rate it has."""
    torque, set_point = 0.03, AttitudeSetPoint(DRIVE, COPTER)
    for omega_z in (-0.4, 0.0, 0.7):
        given, omega = HOVERS + torque * np.eye(6)[5], np.array([0.0, 0.0, omega_z])
        yaw_rate = set_point.of(HOVERS[:3], given, np.eye(3), omega, H)[2]
        turns = (yaw_rate - omega_z) / DRIVE.yaw_lag_s
        assert turns == pytest.approx(torque / COPTER.inertia[2])


def test_nothing_is_told_beyond_the_robot_s_file():
    rng, set_point = np.random.default_rng(3), AttitudeSetPoint(DRIVE, COPTER)
    for _ in range(2000):
        force = rng.normal(size=3) * 10.0 ** rng.uniform(-3, 3)
        given = np.abs(rng.normal(size=6)) * 10.0 ** rng.uniform(-3, 3)
        R_fb, omega = exp(0.5 * rng.normal(size=3)), 5.0 * rng.normal(size=3)
        told = set_point.of(force, given, R_fb, omega, H)
        assert np.isfinite(told).all()
        roll, pitch, yaw_rate, _ = told.tolist()
        assert not DRIVE.exceeds(roll, pitch, yaw_rate, 1.0 + 1e-9)


def test_no_jump_of_the_force_spins_it_faster_than_a_flight_allows():
    """An autopilot turns at 1/T for each radian between what it is told and its lean."""
    set_point, lean = AttitudeSetPoint(DRIVE, COPTER), LeanModel(DRIVE)
    fastest = 0.0
    for k in range(200):
        side = 5.0 if k // 25 % 2 else -5.0
        force = np.array([side, side, WEIGHT])
        R_fb = R_from_rpy(np.array([*lean.lean, 0.0]))
        told = set_point.of(force, HOVERS, R_fb, STILL, H)
        fastest = max(fastest, hypot(*(told[:2] - lean.lean).tolist()) / DRIVE.lag_s)
        lean.follow(told[:2], H)
    assert 0.9 * MOST_RATE < fastest < 1.01 * MOST_RATE


def leaning(off, seconds, thrust=WEIGHT):
    """How far a body leans at last that is off level by (2,) [rad] and is to be upright."""
    set_point, lean = AttitudeSetPoint(DRIVE, COPTER), LeanModel(DRIVE)
    for _ in range(round(seconds / H)):
        rpy = np.array([*(lean.lean + off), 0.3])
        given, R_fb = thrust / WEIGHT * HOVERS, R_from_rpy(rpy)
        set_point.learn(R_fb, H)
        told = set_point.of(np.array([0.0, 0.0, GRAVITY]), given, R_fb, STILL, H)
        lean.follow(told[:2], H)
    return lean.lean + off


def test_a_vertical_that_is_not_ours_is_learnt():
    off = np.radians([0.8, -0.5])
    assert np.abs(leaning(off, 0.4)).max() > np.radians(0.4), "it may stand"
    assert np.abs(leaning(off, 5.5)).max() < np.radians(0.02)


def test_on_the_floor_nothing_is_learnt_of_it():
    off = np.radians([0.8, -0.5])
    np.testing.assert_allclose(leaning(off, 5.0, thrust=0.5 * WEIGHT), off, atol=1e-9)


def test_what_holds_it_tilted_is_no_vertical():
    off = np.array([radians(20.0), 0.0])
    left = leaning(off, 20.0)
    assert left[0] == pytest.approx(off[0] - MOST_TRIM, abs=1e-3)


def test_a_lean_that_follows_as_modelled_teaches_nothing():
    """However quickly the force changes: what the lag leaves behind is no vertical."""
    set_point, lean = AttitudeSetPoint(DRIVE, COPTER), LeanModel(DRIVE)
    for k in range(2000):
        force = np.array([2.0 * np.sin(0.03 * k), 1.5 * np.sin(0.011 * k), WEIGHT])
        R_fb = R_from_rpy(np.array([*lean.lean, 0.0]))
        set_point.learn(R_fb, H)
        told = set_point.of(force, HOVERS, R_fb, STILL, H)
        lean.follow(told[:2], H)
    for _ in range(400):
        R_fb = R_from_rpy(np.array([*lean.lean, 0.0]))
        told = set_point.of(HOVERS[:3], HOVERS, R_fb, STILL, H)
        lean.follow(told[:2], H)
    assert np.abs(told[:2]).max() < np.radians(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("pushed", ["x", "y"])
def test_its_way_aside_diverges_beyond_its_delay_margin_alone(pushed):
    """The frequency response of the margins and this loop in time are two accounts of one."""
    axis, file = "xy".index(pushed), load_robot("copter", takes=COMMANDS)
    own = file.gains["phone"]  # stiffer, so that the lag counts of which it is told ahead
    gains = replace(own, Kp=4.0 * own.Kp, Ki=np.zeros(6), Kd=3.0 * own.Kd)
    body = dynamics_of(COPTER, file.plant)
    loop = Loop(body, gains, MarginsConfig(unfelt=0.0), NoFilterConfig())
    margin = axis_margins(loop, axis, Sensing("relative", latency=0.0, body_age=0.0)).delay
    assert 0.05 < margin < 0.2

    def grows(late):
        drive = replace(DRIVE, delay_s=DRIVE.delay_s + late)
        flies, set_point = LeanModel(drive), AttitudeSetPoint(DRIVE, COPTER)
        x, v, sizes = 0.01, 0.0, []
        for _ in range(4000):
            force = np.array([0.0, 0.0, WEIGHT])
            force[axis] = -gains.Kp[axis] * x - gains.Kd[axis] * v
            R_fb = R_from_rpy(np.array([*flies.lean, 0.0]))
            told = set_point.of(force, 0.0 * HOVERS, R_fb, STILL, H)
            for _ in range(5):
                v += 0.2 * H * (WEIGHT * R_fb[axis, 2] - body.damping[axis] * v) / COPTER.mass
                x += 0.2 * H * v
            flies.follow(told[:2], H)
            sizes.append(abs(x))
            if sizes[-1] > 1.0:
                return True
        return max(sizes[-1000:]) > max(sizes[1000:2000])

    assert not grows(0.85 * margin)
    assert grows(1.15 * margin)
