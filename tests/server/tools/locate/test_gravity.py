from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.frames import R_cd, R_co, R_from_rpy
from pipeline.vision.detection import FramePrior
from server.tools.locate.gravity import GravityDoubt

UP = np.array([0.0, 0.0, 1.0])


def told(R_wrong, n=20, confirmed=0):
    """What is said when the camera's file has its axes turned by `R_wrong`."""
    rng, doubt = np.random.default_rng(5), GravityDoubt()
    for k in range(n + confirmed):
        R_fc, R_fb = (R_from_rpy(rng.uniform(-0.3, 0.3, 3)) for _ in range(2))
        denied = SimpleNamespace(R_cb=R_fc.T @ R_fb)
        is_denied = k < n
        doubt.add(
            SimpleNamespace(
                prior=FramePrior(R_wrong @ R_fc.T @ UP, R_fb.T @ UP),
                pose=None if is_denied else denied,
                detection=SimpleNamespace(unbelieved=denied if is_denied else None),
            )
        )
    return doubt.words("imu.csv", "body.csv")


MISTAKES = [
    (R_co.T, "imu.csv is in optical axes"),
    (-np.eye(3), "an accelerometer has the opposite sign"),
    (R_cd(0.0).T, "a phone held upright"),
    (R_cd(90.0).T, "a phone turned left"),
    (R_cd(270.0).T, "a phone turned right"),
]


@pytest.mark.parametrize(("R_wrong", "words"), MISTAKES)
def test_usual_mistakes_are_named(R_wrong, words):
    (said,) = told(R_wrong)
    assert said.startswith("in 20 frames the lights give a pose that gravity denies by ")
    assert words in said
    assert said.endswith("then it would fit to 0°")


def test_of_others_the_right_axes_are_told():
    (said,) = told(R_from_rpy(np.array([0.6, 0.6, 0.0])))
    assert "imu.csv must be in camera axes (x forward, y left, z up)" in said
    assert "body.csv in those of the robot file" in said


def test_a_few_denied_poses_among_many_good_ones_are_no_mistake():
    assert told(-np.eye(3), n=4) == []
    assert told(-np.eye(3), n=20, confirmed=20) == []


def test_without_both_verticals_nothing_is_said():
    doubt = GravityDoubt()
    detection = SimpleNamespace(unbelieved=SimpleNamespace(R_cb=np.eye(3)))
    for ups in ((None, UP), (UP, None)) * 10:
        doubt.add(SimpleNamespace(prior=FramePrior(*ups), pose=None, detection=detection))
    doubt.add(SimpleNamespace(prior=FramePrior(UP, UP), pose=None, detection=None))
    assert doubt.words("imu.csv", "body.csv") == []
