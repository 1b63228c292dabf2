"""What is believed of a robot that tells its own motion, and which way is up for it."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config import TeleopConfig
from pipeline.estimation.estimators import make_estimator
from pipeline.estimation.sensor_doubts import sensor_doubts
from pipeline.estimation.sensor_monitor import SensorMonitor
from pipeline.estimation.told_motion import ToldTwist, ToldVertical, for_body
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import GRAVITY, R_from_rpy, exp
from pipeline.imu_stream import ImuStream
from pipeline.robot import ToldMotion
from pipeline.signals import BodyImu

MEASURED = ToldMotion(
    is_measured=True,
    is_level=True,
    tilt=0.03,
    interval_s=0.05,
    noise_v=0.01,
    noise_omega=0.01,
    slip=0.03,
    unlike_s=0.03,
)
COMMANDED = replace(MEASURED, is_measured=False, slip=0.1, unlike_s=0.06)
FORWARD = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.5])
LEDS = np.eye(3)


def doubts(motion, twist_of, seconds=1.0):
    told = ToldTwist(motion)
    for t in np.arange(0.0, seconds, 0.005):
        found = told.doubts(float(t), twist_of(t))
    return found


@pytest.mark.parametrize("motion", [MEASURED, COMMANDED])
def test_who_moves_is_believed_less_than_who_stands(motion):
    rest, goes, runs = (
        doubts(motion, lambda _, speed=speed: speed * FORWARD) ** 2 for speed in (0.0, 1.0, 2.0)
    )
    assert (goes[:2] > 1.2 * rest[:2]).all()
    assert (runs - rest)[:2] == pytest.approx(4.0 * (goes - rest)[:2])


def test_who_only_says_what_he_was_told_is_believed_less_while_that_changes():
    def swings(t):
        return np.sin(4.0 * t) * FORWARD

    steady, swinging = doubts(COMMANDED, lambda _: 0.0 * FORWARD), doubts(COMMANDED, swings, 0.8)
    assert swinging[2] > 2.0 * steady[2]
    measured = doubts(MEASURED, swings, 0.8)[2] / doubts(MEASURED, lambda _: 0.0 * FORWARD)[2]
    assert measured < 1.5  # what it finds it takes off


def test_no_sensors_that_it_does_not_have_are_learnt_or_blamed():
    config = for_body(RelativeConfig(), MEASURED)
    assert not config.body_steps
    assert config.initial_omega_b < 1e-4
    assert config.initial_f_b == pytest.approx(GRAVITY * MEASURED.tilt)
    assert for_body(RelativeConfig(), None) == RelativeConfig()
    now, never = np.full(2, 10.0), np.full(4, -np.inf)
    arguments = (
        10.0,
        0.0,
        never,
        never,
        now,
        np.full(2, -np.inf),
        np.full(4, 9.0),
        np.ones(2),
        1.0,
        0.0,
    )
    said = sensor_doubts(*arguments, of_body=False)
    assert len(said) == 4
    assert not any("robot's" in words or "of the robot" in words for words in said)
    assert sum("or the robot moves otherwise than it says" in words for words in said) == 2
    assert all("the robot or the phone" in words for words in sensor_doubts(*arguments))


def test_a_vertical_that_turns_carry_on_wanders_as_their_noise_makes_it():
    hangs = replace(MEASURED, is_level=False, noise_omega=0.05)
    rng, runs, seconds = np.random.default_rng(5), 200, 4.0
    turned = np.zeros(runs)
    for _ in range(round(seconds / hangs.interval_s)):
        turned += hangs.interval_s * hangs.noise_omega * rng.normal(size=runs)
    wanders = GRAVITY * float(np.std(turned)) / np.sqrt(seconds)
    assert for_body(RelativeConfig(), hangs).walk_f_b == pytest.approx(wanders, rel=0.15)
    assert for_body(RelativeConfig(), MEASURED).walk_f_b == RelativeConfig().walk_f_b


def test_a_twist_that_stays_is_no_sensor_that_is_stuck():
    stuck, told = SensorMonitor(), SensorMonitor(of_body=False)
    for k in range(100):
        for monitor in (stuck, told):
            monitor.add_body_imu(BodyImu(0.005 * k, np.zeros(3), np.zeros(3), np.zeros(6)))
    assert stuck.frozen
    assert not told.frozen
    assert not told.jumped


def test_the_paper_s_filter_is_refused_by_name_for_who_has_no_sensors():
    config = replace(TeleopConfig(), estimator="paper")
    with pytest.raises(ValueError, match="'paper' needs motion sensors"):
        make_estimator(config, LEDS, MEASURED)


def test_one_that_stands_level_knows_its_vertical():
    vertical = ToldVertical(MEASURED)
    assert vertical.force(1.0, FORWARD[3:]).tolist() == [0.0, 0.0, GRAVITY]
    assert vertical.is_known


def test_of_another_one_the_phone_and_a_picture_tell_and_its_turns_carry_it_on():
    vertical = ToldVertical(replace(MEASURED, is_level=False))
    R_fb, omega = R_from_rpy(np.array([0.3, -0.4, 1.0])), np.array([0.5, -0.3, 0.2])
    R_cb = R_from_rpy(np.array([0.1, 0.2, 3.0]))
    phone, body = ImuStream(), ImuStream(more=6)
    up = np.array([0.0, 0.0, GRAVITY])
    for t in np.arange(0.0, 0.4, 0.005).tolist():
        assert not vertical.force(t, omega).any()
        body.insert(t, omega, vertical.force(t, omega), np.zeros(6))
        phone.insert(t, np.zeros(3), R_cb @ R_fb.T @ up)
    vertical.learn(0.2, R_cb, phone, body)
    for t, row in zip(body.times, body.values, strict=True):
        assert row[3:6] == pytest.approx(exp(-(t - 0.2) * omega) @ R_fb.T @ up, abs=1e-3)
    later = vertical.force(0.5, omega)
    assert later == pytest.approx(exp(-0.3 * omega) @ R_fb.T @ up, abs=1e-2)
    vertical.learn(0.3, np.eye(3), phone, body)  # it is known
    assert vertical.force(0.5, omega) == pytest.approx(later)
