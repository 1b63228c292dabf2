"""VisualFrontEnd: what is known before a frame is as of its own time, by both motion sensors."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.scenes.scene import SCENES, VGA
from hardware.sim.scenes.video import RenderedVideo
from pipeline.frames import GRAVITY, exp
from pipeline.signals import BodyImu, Frame, PhoneImu
from pipeline.vision.robot_identity import ELSEWHERE, TWO
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B

UP = np.array([0.0, 0.0, 1.0])
PITCHING, ROLLING = np.array([0.0, 0.4, 0.0]), np.array([-0.7, 0.0, 0.0])
DARK = np.zeros((CAMERA.height, CAMERA.width), np.uint8)


def felt_by(kind, omega, t):
    """What turns at `omega` and was upright at 0."""
    return kind(t, omega, GRAVITY * exp(-t * omega) @ UP)


@pytest.fixture
def front_end():
    made = VisualFrontEnd(CAMERA, LEDS_IN_B, GatesConfig())
    for k in range(100):
        made.add_imu(felt_by(BodyImu, ROLLING, 0.01 * k), felt_by(PhoneImu, PITCHING, 0.01 * k))
    return made


def test_verticals_and_rates_are_those_of_the_frame_not_of_the_newest_samples(front_end):
    t = 0.865
    prior = front_end.process(Frame(t, DARK)).prior
    for up, omega in ((prior.up_in_c, PITCHING), (prior.up_in_b, ROLLING)):
        assert up @ (exp(-t * omega) @ UP) > np.cos(np.radians(0.2))
        assert up @ (exp(-0.99 * omega) @ UP) < np.cos(np.radians(2.0))
    np.testing.assert_allclose(prior.omega_cf_in_c, PITCHING, atol=1e-12)
    np.testing.assert_allclose(prior.omega_bf_in_b, ROLLING, atol=1e-12)


@pytest.mark.slow
def test_when_ours_goes_dark_no_other_one_is_told_instead():
    film = RenderedVideo(replace(SCENES["twin_left"], dark_after_s=1.0), 2, VGA, 75)
    eyes, told = VisualFrontEnd(film.camera, film.leds_in_b, GatesConfig()), 0
    for shot in film:
        eyes.add_imu(*shot.phone, *shot.body)
        detection = eyes.process(Frame(shot.t, shot.luma))
        if detection.pose is None:
            assert detection.reason in (TWO, ELSEWHERE)
            continue
        told += 1
        assert shot.solvable
        assert np.linalg.norm(detection.pose.p_bc_in_c - shot.p_bc_in_c) < 0.05
    assert told > 10


def test_of_a_sensor_that_is_silent_nothing_is_known():
    quiet = VisualFrontEnd(CAMERA, LEDS_IN_B, GatesConfig())
    quiet.add_imu(felt_by(PhoneImu, PITCHING, 0.0))
    prior = quiet.process(Frame(0.0, DARK)).prior
    assert prior.up_in_c is not None
    assert prior.up_in_b is None
    assert prior.omega_bf_in_b is None
