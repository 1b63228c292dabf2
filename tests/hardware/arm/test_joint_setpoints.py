"""Angles that servos are told, and what is known of the tip's motion by them."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.arm.inverse_kinematics import InverseKinematics
from hardware.arm.joint_setpoints import AHEAD_RAD, JointSetpoints
from hardware.arm.tip_odometry import TipOdometry
from hardware.sim.plant.arm_plant import ENCODER_STEP_RAD
from tests.hardware.arm.arms import ARM, AXES, H_S, HOME, PARAMETERS

FORWARD = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
LAG_S = 0.03


def setpoints(q=HOME):
    return JointSetpoints(InverseKinematics(ARM, AXES), q)


def test_a_twist_goes_on_from_what_was_told_whatever_servos_lag_or_bend():
    one = setpoints()
    bent = HOME + 0.01
    for _ in range(100):
        told = one.follow(FORWARD, bent, H_S)
        bent = bent + 0.2 * (told + 0.01 - bent)
    moved = ARM.tip(one.wanted)[1] - ARM.tip(HOME)[1]
    assert moved == pytest.approx([0.05, 0.0, 0.0], abs=0.001)


def test_servos_are_told_where_they_shall_be_after_their_lag():
    one, lagging = setpoints(), HOME.copy()
    follows = 1.0 - np.exp(-H_S / PARAMETERS.servo_lag_s)
    for _ in range(100):
        lagging = lagging + follows * (one.follow(FORWARD, lagging, H_S) - lagging)
    assert lagging == pytest.approx(one.wanted, abs=0.004)
    assert one.rates == pytest.approx(np.linalg.pinv(ARM.jacobian(lagging)) @ FORWARD, abs=0.03)
    one.follow(np.zeros(6), lagging, H_S)
    assert not one.rates.any()


def test_an_arm_that_is_held_is_told_to_be_little_ahead_and_comes_back_at_once():
    held = setpoints()
    for _ in range(400):
        held.follow(FORWARD, HOME, H_S)
        ahead = np.abs(held.wanted - HOME)
        assert ahead.max() <= AHEAD_RAD + 1e-9
    assert held.rates == pytest.approx(np.zeros(5), abs=1e-3)
    held.follow(-FORWARD, HOME, H_S)
    assert np.abs(held.wanted - HOME).max() < ahead.max()


def test_an_arm_that_begins_beyond_its_range_is_told_to_be_in_it():
    told = setpoints(ARM.high + 0.1).follow(np.zeros(6), ARM.high + 0.1, H_S)
    assert (told <= ARM.high).all()


def test_an_encoder_that_tells_a_wild_angle_once_moves_no_servo_faster_than_it_turns():
    one = setpoints()
    before = one.follow(np.zeros(6), HOME, H_S)
    wild = HOME + np.array([0.0, -3.0, 3.0, 0.0, 0.0])
    told = one.follow(np.zeros(6), wild, H_S)
    most = PARAMETERS.rate * (H_S + PARAMETERS.servo_lag_s)
    assert np.abs(told - before).max() <= most + 1e-9
    assert one.follow(np.zeros(6), HOME, H_S) == pytest.approx(one.wanted)


def observed(speed_rad_s, told):
    """Twists known of joints that truly turn so, from rest, by encoders' steps."""
    q, rates, odometry, known, true = HOME.copy(), np.zeros(5), None, [], []
    odometry = TipOdometry(ARM, LAG_S, HOME)
    for k in range(200):
        wanted = speed_rad_s * np.sin(2.0 * np.pi * k * H_S) * np.array([1.0, -0.5, 0.5, 0.3, 1.0])
        before = rates
        rates = wanted + np.exp(-H_S / LAG_S) * (rates - wanted)
        q = q + 0.5 * H_S * (before + rates)
        encoders = ENCODER_STEP_RAD * np.round(q / ENCODER_STEP_RAD)
        odometry.step(wanted if told else np.zeros(5), encoders, H_S)
        known.append(odometry.twist_in_b)
        true.append(ARM.jacobian(q) @ rates)
    return np.array(known), np.array(true)


def test_a_motion_that_was_told_is_known_as_it_is_now():
    known, true = observed(0.5, told=True)
    assert np.abs(true[:, :3]).max() > 0.1
    off = known - true
    assert np.sqrt((off[:, :3] ** 2).mean()) < 0.004
    assert np.sqrt((off[:, 3:] ** 2).mean()) < 0.01


def test_a_motion_that_nobody_told_is_known_a_little_later():
    """A hand pushes it on with one speed."""
    odometry, q, push = TipOdometry(ARM, LAG_S, HOME), HOME.copy(), 0.3 * np.eye(5)[0]
    for _ in range(round(0.4 / H_S)):
        q = q + H_S * push
        odometry.step(np.zeros(5), ENCODER_STEP_RAD * np.round(q / ENCODER_STEP_RAD), H_S)
    assert odometry.twist_in_b == pytest.approx(ARM.jacobian(q) @ push, abs=0.01)


def test_what_stands_still_between_two_steps_of_its_encoders_is_known_to_stand_still():
    odometry = TipOdometry(ARM, LAG_S, HOME)
    for _ in range(200):
        odometry.step(np.zeros(5), HOME, H_S)
    assert not odometry.twist_in_b.any()
