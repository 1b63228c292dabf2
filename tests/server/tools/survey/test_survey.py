"""Surveys recover LEDs from what a hand-held phone sees of them, or say why not."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import yaml

from hardware.camera_file import find_camera, find_camera_file
from hardware.robot_file import load_robot
from server.tools.survey.command import main
from server.tools.survey.reconstruction.bundle import DistanceConstraint
from server.tools.survey.reconstruction.datum import fitted, levelled, matched
from server.tools.survey.reconstruction.detections import tracks_of
from server.tools.survey.reconstruction.errors import SurveyError
from server.tools.survey.reconstruction.gyro import GyroAttitude
from server.tools.survey.reconstruction.structure import measured, shape
from tests.server.tools.survey.survey_film import Walk, spots_only, write_film

CAMERA = find_camera("lightleash-virtual-phone", 1280, 720)
AMES = load_robot("ames").robot.leds_in_b
WALK = Walk(seconds=4.0)
FRAMES = 80
IN_LINE = ["--known", "1=0,0,0", "--known", "2=0,0,0.1", "--known", "3=0,0,0.3"]


def surveyed(
    leds, walk=WALK, camera=CAMERA, gyro=False, seed=1, tape_off=0.0, frames=FRAMES, **film
):
    seen = spots_only(camera, walk, leds, frames, np.random.default_rng(seed), **film)
    felt = GyroAttitude(walk.imu(), np.array([s.t for s in seen])) if gyro else None
    found = shape(camera, seen, len(leds), felt)
    order = matched(found.scene.points, leds)
    length = float(np.linalg.norm(leds[0] - leds[1])) + tape_off
    return measured(camera, seen, found, order, (DistanceConstraint(0, 1, length, 1e-4),), felt)


def errors(answer, leds):
    """(n, 3) in the robot's axes with their standard deviations."""
    near, R, _, _ = fitted(answer.scene.points, leds)
    turn = np.kron(np.eye(len(leds)), R)
    sigma = np.sqrt(np.diag(turn @ answer.covariance @ turn.T)).reshape(-1, 3)
    return near - leds, sigma


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 5])
def test_leds_come_back_within_their_uncertainty(count):
    leds = AMES[:count]
    off, sigma = errors(surveyed(leds), leds)
    assert np.abs(off).max() < 1e-3
    assert (np.abs(off) < 4.0 * sigma).all()
    assert sigma.max() < 5e-4


@pytest.mark.slow
def test_a_flat_rig_comes_back_too():
    flat = AMES * np.array([0.02, 1.0, 1.0])
    off, _ = errors(surveyed(flat), flat)
    assert np.abs(off).max() < 1e-3


@pytest.mark.slow
def test_hidden_leds_do_no_harm():
    answer = surveyed(AMES, hidden=0.05)
    off, _ = errors(answer, AMES)
    assert np.abs(off).max() < 1e-3
    assert answer.held_out_px < 0.1


@pytest.mark.slow
def test_uncertainty_is_honest_over_many_films():
    nees = []
    rng = np.random.default_rng(0)
    for seed in range(12):
        answer = surveyed(AMES, seed=seed, tape_off=rng.normal(0.0, 1e-4), frames=40)
        off, _ = errors(answer, AMES)
        R = fitted(answer.scene.points, AMES)[1]
        turn = np.kron(np.eye(5), R)
        information = np.linalg.pinv(turn @ answer.covariance @ turn.T, rcond=1e-9)
        nees.append(off.ravel() @ information @ off.ravel())
    freedom = 3 * 5 - 6
    assert 0.7 < np.mean(nees) / freedom < 1.4


def test_the_mirror_image_is_refuted_and_the_size_is_the_measured_one():
    seen = spots_only(CAMERA, WALK, AMES, FRAMES, np.random.default_rng(7))
    found = shape(CAMERA, seen, 5, None)
    points = found.scene.points
    order = matched(points, AMES)
    with pytest.raises(SurveyError, match=r"laid out otherwise|two ways"):
        matched(points * [1.0, 1.0, -1.0], AMES)
    assert found.rival > 1.5
    answer = measured(CAMERA, seen, found, order, (DistanceConstraint(0, 1, 0.7, 1e-4),))
    a, b = answer.scene.points[:2]
    assert np.linalg.norm(a - b) == pytest.approx(0.7, abs=1e-6)
    near, _, _, scale = fitted(answer.scene.points, AMES, scale=True)
    assert np.abs(near - AMES).max() < 5e-4
    assert 1.0 / scale == pytest.approx(0.7 / np.linalg.norm(AMES[0] - AMES[1]), rel=1e-3)


@pytest.mark.slow
def test_a_gyroscope_undoes_the_rolling_shutter():
    rolling = replace(CAMERA, readout_s=0.03)
    without = surveyed(AMES, camera=rolling)
    with_it = surveyed(AMES, camera=rolling, gyro=True)
    assert with_it.held_out_px < 0.07 < 0.1 < without.held_out_px
    assert np.abs(errors(with_it, AMES)[0]).max() < 1e-3


@pytest.mark.parametrize("degrees", [pytest.param(0.3, marks=pytest.mark.slow), 3.0])
def test_without_parallax_there_is_no_answer(degrees):
    still = Walk(azimuth_deg=degrees, elevation_deg=0.5 * degrees, seconds=4.0)
    with pytest.raises(SurveyError, match=r"too little parallax.*walk about the robot"):
        surveyed(AMES, still)


def test_more_lights_than_leds_are_refused_unless_they_are_dim():
    lamp = np.vstack((AMES, [[0.1, 0.05, 0.3]]))
    seen = spots_only(CAMERA, WALK, lamp, FRAMES, np.random.default_rng(1))
    with pytest.raises(SurveyError, match="6 steady lights, but 5 LEDs"):
        shape(CAMERA, seen, 5, None)


def test_lights_are_followed_through_gaps():
    seen = spots_only(CAMERA, WALK, AMES, FRAMES, np.random.default_rng(2), hidden=0.05)
    long = [track for track in tracks_of(seen) if len(track.spots) > 0.8 * FRAMES]
    assert len(long) == 5


def test_a_design_is_matched_whatever_pose_and_scale():
    order = [3, 0, 4, 1, 2]
    turned = 1.7 * levelled(AMES, np.array([0.2, 0.3, 0.9]))[order] + 0.3
    assert [order[k] for k in matched(turned, AMES)] == list(range(5))
    square = np.array([[0.0, 1, 1], [0, -1, 1], [0, -1, -1], [0, 1, -1]])
    with pytest.raises(SurveyError, match="two ways"):
        matched(square, square)
    with pytest.raises(SurveyError, match="laid out otherwise"):
        matched(AMES[:4] * [0.0, 1.0, 0.2], AMES[:4])


def test_a_fit_is_a_rotation_even_of_a_mirror_image():
    near, R, t, scale = fitted(AMES, AMES * [1.0, -1.0, 1.0])
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert scale == 1.0
    assert near == pytest.approx(AMES @ R.T + t)


def test_a_gyroscope_that_misses_a_part_is_refused():
    times = np.linspace(0.0, 2.0, 20)
    with pytest.raises(SurveyError, match="must cover the film"):
        GyroAttitude(WALK.imu()[:200], times)


@pytest.mark.slow
def test_a_rendered_film_becomes_a_file(tmp_path, capsys):
    frames = tmp_path / "frames"
    frames.mkdir()
    path, camera = find_camera_file("lightleash-virtual-phone", 1280, 720)
    table = yaml.safe_load(path.read_text()) | {"rolling_shutter_readout_s": 0.02}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(table))
    imu = write_film(frames, replace(camera, readout_s=0.02), Walk(), AMES, 60)
    length = float(np.linalg.norm(AMES[0] - AMES[1]))
    out = tmp_path / "leds.toml"
    words = [str(frames), "--camera", str(tmp_path / "camera.yaml"), "--leds", "5"]
    words += ["--distance", f"1,2={length:.5f}", "--imu", str(imu), "--out", str(out)]
    assert main([*words, "--design", "ames"]) == 0
    assert "Verdict: good" in capsys.readouterr().out
    places = [row["position_in_body_m"] for row in tomllib.loads(out.read_text())["leds"]]
    figures = json.loads(out.with_suffix(".json").read_text())
    off = np.array(places) - AMES
    assert np.abs(off).max() < 1e-3
    assert (np.abs(off) < 3.0 * np.array(figures["sigma_m"]) + 1e-6).all()
    assert figures["held_out_px"] < 0.1
    assert out.with_suffix(".png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--leds", "3", "--distance", "1,2=0.3"], "from 4 to 8"),
        (["--leds", "5", "--distance", "1,7=0.3"], "there are 5"),
        (["--leds", "5", "--distance", "1,2=0.3", "--known", "1=0,0,0"], "at least three"),
        (["--leds", "5", "--distance", "1,2=0.3", "--every", "0"], "--every"),
        (["--leds", "5", "--distance", "1,2=0.3", "--out", "leds.json"], "ending in .toml"),
        (["--leds", "5", "--distance", "1,2=0.3", *IN_LINE], "not all on one line"),
    ],
)
def test_wrong_options_are_told_in_a_line(tmp_path, capsys, words, told):
    always = [str(tmp_path), "--camera", "none.yaml", "--out", str(tmp_path / "leds.toml")]
    assert main([*always, *words]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("said", ["1,2", "1,1=0.3", "0,2=0.3", "1,2=30", "1,2=nan", "1=0.3"])
def test_a_distance_that_is_none_is_refused(said, capsys):
    with pytest.raises(SystemExit):
        main(["f", "--camera", "c", "--leds", "5", "--out", "o", "--distance", said])
    assert "--distance" in capsys.readouterr().err
