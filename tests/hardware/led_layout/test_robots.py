"""LEDs of each robot tell themselves apart, seen as its flights begin, among lamps."""

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.robot_file import load_robot
from pipeline.frames import R_from_rpy, exp
from pipeline.identification.initialisation import Initialisation
from pipeline.identification.relocalisation import SearchHints
from pipeline.signals import Spots
from pipeline.vision_config import IdentifyConfig

CAMERA = find_camera("lightleash-virtual-phone", 1280, 720)
UP = np.array([0.0, 0.0, 1.0])
VIEWS = 100
SPREAD_RAD = np.deg2rad(12.0)
"""Of the phone's height and the robot's tilt about those of the start."""
YAW_RAD, GRAVITY_RAD = np.deg2rad(35.0), np.deg2rad(3.0)
LAMPS = 3


def view(rng, start):
    """(R_fc, R_fb, p_bc_in_c) of a phone about where flights start, looking about at the robot."""
    elevation = np.arctan2(start.above, start.distance) + rng.uniform(-1.0, 1.0) * SPREAD_RAD
    distance = rng.uniform(1.6, 3.4)
    p_in_f = distance * np.array([np.cos(elevation), rng.uniform(-0.2, 0.2), -np.sin(elevation)])
    roll, pitch = rng.uniform(-0.1, 0.1, 2)
    R_fc = R_from_rpy(np.array([roll, elevation + pitch, 0.0]))
    tilt = rng.uniform(-0.5, 0.5, 2) * SPREAD_RAD
    return R_fc, R_from_rpy(np.array([*tilt, rng.uniform(-YAW_RAD, YAW_RAD)])), R_fc.T @ p_in_f


def spots_of(rng, leds_px):
    lights = [led + rng.normal(0.0, 0.04, 2) for led in leds_px]
    while len(lights) < len(leds_px) + LAMPS:
        lamp = rng.uniform(0.05, 0.95, 2) * (CAMERA.width, CAMERA.height)
        if np.linalg.norm(np.array(lights) - lamp, axis=1).min() > 25.0:
            lights.append(lamp)
    order = rng.permutation(len(lights))
    count = len(lights)
    covariances = np.tile(0.04**2 * np.eye(2), (count, 1, 1))
    return Spots(np.array(lights)[order], covariances, np.ones(count), np.full(count, 20.0))


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground"])
def test_no_led_is_taken_for_another_or_a_lamp(name):
    robot_file, rng, found = load_robot(name), np.random.default_rng(4), 0
    leds_in_b = robot_file.robot.leds_in_b
    for _ in range(VIEWS):
        R_fc, R_fb, p_bc_in_c = view(rng, robot_file.start)
        leds_px = CAMERA.pixels(p_bc_in_c + leds_in_b @ (R_fc.T @ R_fb).T)
        spots = spots_of(rng, leds_px)
        off = rng.normal(0.0, 1.0, 3)
        up_in_c = exp(GRAVITY_RAD * off / np.linalg.norm(off)) @ R_fc.T @ UP
        starting = Initialisation(CAMERA, leds_in_b, IdentifyConfig())
        naming = starting.step(0.0, spots, SearchHints(up_in_c, R_fb.T @ UP), None)
        if naming is not None:
            found += 1
            apart = spots.pixels[naming.match.spot] - leds_px[naming.match.led]
            assert np.abs(apart).max() < 0.5
    assert found > 0.95 * VIEWS
