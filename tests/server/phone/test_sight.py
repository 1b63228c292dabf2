"""What is drawn on the phone's picture lies where the picture shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.frames import wxyz_from_R
from pipeline.signals import Mode
from server.phone.frame_pipeline import FramePipeline
from server.phone.sight import FRESH_S, KNOWN_S, SURE_M, sight
from tests.pipeline.seeing import CAMERA, truth_at
from tests.server.house import control_status
from tests.server.phone.test_frame_pipeline import ROBOT, frame_pipeline, look, shots

LEDS = ROBOT.leds_in_b
LEVEL = (1.0, 0.0, 0.0, 0.0)


def status_of(p_bc_in_c, R_cb, **changes):
    told = {
        "p_bc_in_c": tuple(map(float, p_bc_in_c)),
        "R_cb_wxyz": wxyz_from_R(R_cb),
        "u_bf_in_c": (0.0, 0.0, 0.0),
        "sigma_p": 1e-3,
        "sigma_theta": 1e-3,
        "R_fc_wxyz": LEVEL,
        "pose_age": 0.05,
    }
    return control_status(**(told | changes))


def points(shares):
    return np.array(shares).reshape(-1, 2) * [CAMERA.width, CAMERA.height] - 0.5


def places(p_bc_in_c, R_cb):
    return CAMERA.pixels(p_bc_in_c + LEDS @ R_cb.T)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


@pytest.fixture
def seen(rng) -> tuple:
    """A picture that was looked at, and its truth."""
    eye: FramePipeline = frame_pipeline()
    (frame, truth), *_ = shots(rng, 1)
    (detection,) = (one for one in [look(eye, [frame], truth)] if one.pose is not None)
    return detection, truth


def test_found_lights_and_the_robot_lie_on_its_lights(seen) -> None:
    detection, truth = seen
    said = sight(CAMERA, LEDS, detection, status_of(truth.p, truth.R), detection.t)
    assert (said.width, said.height) == (CAMERA.width, CAMERA.height)
    lights = places(truth.p, truth.R)
    np.testing.assert_allclose(points(said.robot), lights, atol=0.2)
    away = np.linalg.norm(points(said.found)[:, None] - lights[None], axis=2)
    assert len(away) >= 3
    assert (away.min(axis=1) < 1.0).all()
    assert said.distance_m == pytest.approx(float(np.linalg.norm(truth.p)))
    assert said.toward is None
    assert said.goal == []


def test_what_was_seen_long_ago_or_is_unsure_is_not_drawn(seen) -> None:
    detection, truth = seen
    later = detection.t + 1.1 * FRESH_S
    said = sight(CAMERA, LEDS, detection, status_of(truth.p, truth.R), later)
    assert said.found == []
    assert said.robot
    for unknown in ({"pose_age": 1.1 * KNOWN_S}, {"sigma_p": 1.1 * SURE_M}):
        said = sight(CAMERA, LEDS, detection, status_of(truth.p, truth.R, **unknown), later)
        assert (said.robot, said.distance_m, said.toward) == ([], None, None)


def test_of_nothing_nothing_is_said() -> None:
    said = sight(CAMERA, LEDS, None, None, 0.0)
    assert (said.found, said.robot, said.goal, said.toward, said.distance_m) == (
        [], [], [], None, None,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("p_bc_in_c", "toward"),
    [
        ((2.0, -3.0, 0.0), 0.0),
        ((2.0, 3.0, 0.0), np.pi),
        ((2.0, 0.0, -3.0), np.pi / 2),
        ((2.0, 0.0, 3.0), -np.pi / 2),
        ((-2.0, -0.1, 0.0), 0.0),
    ],
)
def test_a_robot_outside_has_a_direction(p_bc_in_c, toward) -> None:
    said = sight(CAMERA, LEDS, None, status_of(p_bc_in_c, np.eye(3)), 0.0)
    assert said.toward is not None
    assert np.exp(1j * said.toward) == pytest.approx(np.exp(1j * toward))
    assert said.robot == []


@pytest.mark.parametrize("mode", list(Mode))
def test_where_it_should_be_is_shown_while_it_follows(rng, mode) -> None:
    truth, yaw = truth_at(rng), 0.02
    R_fv = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0],
                     [0.0, 0.0, 1.0]])  # fmt: skip
    leads = status_of(
        truth.p,
        truth.R,
        mode=int(mode),
        R_fv_wxyz=wxyz_from_R(R_fv),
        reference_p_in_v=tuple(map(float, R_fv.T @ truth.p)),
        reference_R_wxyz=wxyz_from_R(R_fv.T @ truth.R),
    )
    said = sight(CAMERA, LEDS, None, leads, 0.0)
    if mode in (Mode.TRACK, Mode.COAST):
        np.testing.assert_allclose(points(said.goal), places(truth.p, truth.R), atol=0.2)
    else:
        assert said.goal == []


def test_a_place_that_is_no_number_is_not_sent() -> None:
    said = sight(CAMERA, LEDS, None, status_of((2.0, float("nan"), 0.0), np.eye(3)), 0.0)
    assert said.robot == []


def test_a_lens_turned_away_from_the_lights_shows_none(seen) -> None:
    detection, truth = seen
    nothing = replace(detection, match=None)
    assert sight(CAMERA, LEDS, nothing, status_of(truth.p, truth.R), detection.t).found == []
