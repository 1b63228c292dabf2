"""Which limits of a flight hold for which robot."""

from math import pi

import pytest

from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import EnvelopeConfig
from pipeline.control.flight_envelope import limits_of


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground", "rover"])
def test_a_robot_that_flies_or_stands_level_is_tilted_too_far_at_some_angle(name):
    limits = EnvelopeConfig()
    assert limits_of(load_robot(name, takes=COMMANDS).robot, limits) == limits


@pytest.mark.parametrize("name", ["twister", "so101"])
def test_one_that_is_carried_and_led_about_roll_and_pitch_tilts_as_it_is_led(name):
    limits = limits_of(load_robot(name, takes=COMMANDS).robot, EnvelopeConfig())
    assert limits.max_tilt_rad == pi
    assert limits.max_error_m == EnvelopeConfig().max_error_m
