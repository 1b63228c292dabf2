"""From views to a camera: right, honest about how sure it is, and refused with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.camera_file import CameraFileError, find_camera_file, load_camera
from pipeline.camera.lens import COLUMNS, ROWS
from pipeline.frames import exp, log
from server.calibration.camera_imu import gyro_of
from server.calibration.camera_yaml import profile_path, store, yaml_of
from server.calibration.job import CalibrationJob, run
from server.calibration.solve import ray_sigma, solve
from server.calibration.verdict import Verdict, bare_side, judge, judge_views
from server.calibration.views import BoardView
from tests.server.calibration.filming import BOARD, Motion, Phone, corner_film, gyro_rows, upright

R_CI = exp(np.array([0.03, -0.02, 0.01]))
OFFSET_S = 0.043


def calibrated(phone, motion, seconds=9.0, gyro=True, seed=0, fps=30.0):
    views = corner_film(phone, motion, seconds, fps, seed=seed)
    felt = gyro_of(gyro_rows(phone, motion, R_CI, OFFSET_S, seconds)) if gyro else None
    return solve(views, BOARD, phone.size, phone.model, felt)


@pytest.fixture(scope="module")
def found():
    return calibrated(Phone(), Motion(seed=1))


def test_lens_readout_and_sensors_are_found(found):
    phone = Phone()
    assert found.shared[:2] == pytest.approx(phone.lens[:2], rel=0.003)
    assert found.shared[2:4] == pytest.approx(phone.lens[2:4], abs=3.0)
    assert found.shared[-1] == pytest.approx(phone.readout_s, rel=0.15)
    assert found.readout_axis == ROWS
    assert found.imu.time_offset_s == pytest.approx(OFFSET_S, abs=0.005)
    assert np.rad2deg(log(found.imu.R_ci @ R_CI.T)) == pytest.approx(np.zeros(3), abs=0.3)


def test_it_says_how_sure_it_is(found):
    truth = np.append(Phone().vector, Phone().readout_s)
    z = (found.shared - truth) / found.sigma
    assert np.abs(z).max() < 4.0
    assert 0.3 < np.sqrt((z * z).mean()) < 2.0
    assert found.held_out_px == pytest.approx(0.1 * np.sqrt(2.0), rel=0.15)
    assert ray_sigma(found).max() < 0.7
    assert judge(found) == Verdict("good", [], [])


def test_one_view_measured_wrongly_condemns_no_lens():
    phone = Phone()
    views = corner_film(phone, Motion(seed=1), 9.0, 30.0, seed=0)
    kept_out = solve(views, BOARD, phone.size, phone.model).choice.held_out[0]
    pixels = kept_out.pixels.copy()
    pixels[len(pixels) // 2] += 80.0
    wrong = replace(kept_out, pixels=pixels)
    found = solve(
        [wrong if view is kept_out else view for view in views], BOARD, phone.size, phone.model
    )
    assert wrong in found.choice.held_out
    assert found.held_out_px == pytest.approx(0.1 * np.sqrt(2.0), rel=0.15)


def test_the_file_is_a_camera_file(found, tmp_path):
    name = 'Pixel "7" \\ back: #1'
    path = profile_path(tmp_path, name, found.size, 90)
    assert path.name == "pixel-7-back-1-1280x720-at-90.yaml"
    store(path, yaml_of(found, judge(found), name, 90, "2026-01-01"))
    read, camera = load_camera(path)
    assert read == name
    assert camera.K[0, 0] == pytest.approx(found.shared[0])
    assert camera.distortion == pytest.approx(found.shared[4:-1])
    assert camera.readout_s == pytest.approx(found.shared[-1], abs=1e-6)
    assert camera.extrinsics.R_ci == pytest.approx(found.imu.R_ci, abs=1e-6)
    assert camera.extrinsics.time_offset_s == pytest.approx(found.imu.time_offset_s, abs=1e-6)
    assert find_camera_file(name, 1280, 720, [tmp_path], 90)[0] == path
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


def test_a_file_that_could_not_be_read_again_leaves_the_one_before(found, tmp_path):
    path, text = tmp_path / "phone.yaml", yaml_of(found, judge(found), "phone", 0, "2026-01-01")
    store(path, text)
    late = replace(found, imu=replace(found.imu, time_offset_s=0.7))
    with pytest.raises(CameraFileError, match="time_offset_s"):
        store(path, yaml_of(late, judge(late), "phone", 0, "2026-01-01"))
    assert path.read_text(encoding="utf-8") == text
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_picture_that_stands_on_its_head_has_a_negative_readout(seed):
    found = calibrated(Phone(readout_s=-0.015), Motion(seed=seed), gyro=False, seed=seed)
    assert found.shared[-1] == pytest.approx(-0.015, rel=0.15)
    assert found.shared[0] == pytest.approx(Phone().lens[0], rel=0.003)


@pytest.mark.slow
def test_a_phone_held_upright_reads_its_pictures_columns(tmp_path):
    phone = Phone(readout_s=0.022)
    views = upright(corner_film(phone, Motion(seed=1), 6.0, seed=1), phone)
    found = solve(views, BOARD, (720, 1280), phone.model)
    assert found.readout_axis == COLUMNS
    assert found.shared[-1] == pytest.approx(-0.022, rel=0.15)
    assert found.shared[:2] == pytest.approx(phone.lens[1::-1], rel=0.003)
    path = tmp_path / "phone.yaml"
    store(path, yaml_of(found, judge(found), "phone", 0, "2026-01-01"))
    camera = load_camera(path)[1]
    assert (camera.readout_axis, camera.readout_s) == (
        COLUMNS,
        pytest.approx(found.shared[-1], abs=1e-6),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "phone",
    [
        Phone(model="rational_polynomial", lens=(930, 934, 646, 352, 0.3, 0.1, 0, 0, 0, 0.2, 0, 0)),
        Phone(model="equidistant", lens=(480, 481, 640, 357, 0.05, -0.02, 0.01, -0.002)),
        Phone(720, 1280, lens=(930, 931, 362, 638, 0.06, -0.1, 0, 0, 0)),
    ],
    ids=["rational", "fisheye", "upright"],
)
def test_other_lenses_and_pictures(phone):
    near = (0.12, 0.3) if phone.model == "equidistant" else (0.28, 0.55)
    found = calibrated(phone, Motion(seed=1, distance_m=near), gyro=False)
    assert found.shared[:2] == pytest.approx(phone.lens[:2], rel=0.003)
    assert found.shared[-1] == pytest.approx(phone.readout_s, rel=0.15)
    assert judge(found).level != "refused"


@pytest.mark.slow
def test_over_many_films_the_errors_are_as_large_as_they_are_said_to_be():
    truth, z = np.append(Phone().vector, Phone().readout_s), []
    for seed in range(4):
        found = calibrated(Phone(), Motion(seed=seed), 6.0, gyro=False, seed=seed)
        z.append((found.shared - truth) / found.sigma)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def photographs(count):
    views = corner_film(Phone(), Motion(), 8.0 * count, 0.125)
    return [view for view in views if len(view) > 20]


def test_single_photographs_give_the_lens_and_say_what_is_missing():
    found = solve(photographs(40), BOARD, Phone().size, "plumb_bob", timed=False)
    assert found.shared[-1] == 0.0
    assert not found.readout_known
    verdict = judge(found)
    assert "readout time was not measured" in " ".join(verdict.reasons)


def refused(views, pictures=None):
    size = Phone().size
    verdict = judge_views(views, pictures or len(views), BOARD, size)
    if verdict is None:
        verdict = judge(solve(views, BOARD, size, "plumb_bob"))
    assert verdict.level == "refused"
    assert verdict.advice
    return " ".join(verdict.reasons)


@pytest.mark.slow
def test_a_film_without_tilt_is_refused_for_the_focal_length():
    views = corner_film(Phone(), Motion(tilt=0.02), 3.0)
    assert "focal length can't be told" in refused(views)


@pytest.mark.slow
def test_a_film_of_the_middle_is_refused_for_its_coverage():
    views = corner_film(Phone(), Motion(reach=0.1, distance_m=(0.6, 0.8)), 3.0)
    assert "% of the picture" in refused(views)


def test_a_few_views_are_refused():
    assert "at least 8" in refused(photographs(6))


def test_one_view_again_and_again_is_refused():
    still = photographs(1)[0]
    views = [replace(still, t=still.t + k / 30.0) for k in range(200)]
    assert "differ from each other" in refused(views)


def test_blurred_views_are_refused():
    views = [replace(view, blur_px=14.0) for view in photographs(40)]
    assert "edges are 14 pixels wide" in refused(views)


def test_a_film_without_a_board_is_refused():
    assert "found in 2 of 300 pictures" in refused(photographs(2), 300)


@pytest.mark.slow
def test_a_bent_board_is_seen_in_the_error():
    rng = np.random.default_rng(0)
    views = [
        BoardView(v.t, v.ids, v.pixels + rng.normal(0, 3.0, v.pixels.shape), v.blur_px)
        for v in corner_film(Phone(), Motion(), 3.0)
    ]
    assert "from where they should" in refused(views)


@pytest.mark.slow
def test_a_view_whose_corners_were_mistaken_is_left_out():
    views = corner_film(Phone(), Motion(), 3.0)
    views[40] = replace(views[40], pixels=views[40].pixels[::-1].copy())
    found = solve(views, BOARD, Phone().size, "plumb_bob")
    assert found.held_out_px < 0.3
    assert found.shared[0] == pytest.approx(Phone().lens[0], rel=0.01)
    assert found.left_out == 1
    assert "views_left_out: 1" in yaml_of(found, judge(found), "phone", 0, "2026-01-01")
    assert not any("do not fit" in reason for reason in judge(found).reasons)
    many = replace(found, left_out=len(found.choice.fit) // 4)
    assert any("do not fit the others" in reason for reason in judge(many).reasons)


def test_the_bare_side_is_named():
    cells = np.ones((6, 8), dtype=int)
    cells[:, :2] = 0
    assert bare_side(cells) == "at the left of the picture"
    cells[:] = 1
    cells[[0, 0, -1, -1], [0, -1, 0, -1]] = 0
    assert bare_side(cells) == "in the corners of the picture"


def test_a_job_without_enough_views_says_so():
    job = CalibrationJob(BOARD, (1280, 720), [], 50, np.zeros((0, 4)), "a phone", 90, "2026-01-01")
    outcome = run(job)
    assert (outcome.verdict.level, outcome.text) == ("refused", "")
