import copy

import numpy as np
import pytest
import yaml

from hardware.camera_file import (
    CAMERAS,
    CameraFileError,
    direction_of,
    find_camera,
    find_camera_file,
    load_camera,
    slug,
)
from pipeline.camera.lens import COLUMNS, ROWS
from pipeline.frames import exp

INFO = yaml.safe_load((CAMERAS / "virtual_phone.yaml").read_text())
KALIBR = {
    "cam0": {
        "camera_model": "pinhole",
        "intrinsics": [930.0, 931.0, 646.0, 354.0],
        "distortion_model": "radtan",
        "distortion_coeffs": [0.06, -0.11, 0.0006, -0.0004],
        "resolution": [1280, 720],
    }
}


def changed(table, path, value):
    table = copy.deepcopy(table)
    *parents, key = path
    at = table
    for parent in parents:
        at = at[parent]
    if value is None:
        at.pop(key, None)
    else:
        at[key] = value
    return table


def written(tmp_path, table, name="phone.yaml"):
    path = tmp_path / name
    path.write_text(table if isinstance(table, str) else yaml.safe_dump(table))
    return path


def test_a_camera_info_file_is_read(tmp_path):
    table = changed(INFO, ["rolling_shutter_readout_s"], 0.016)
    name, camera = load_camera(written(tmp_path, table))
    assert name == "lightleash-virtual-phone"
    assert (camera.width, camera.height, camera.model) == (1280, 720, "plumb_bob")
    assert camera.K.tolist() == [[930.0, 0.0, 646.0], [0.0, 931.5, 354.0], [0.0, 0.0, 1.0]]
    assert camera.distortion.tolist() == [0.06, -0.11, 0.0006, -0.0004, 0.0]
    assert camera.readout_s == 0.016


def test_what_is_ours_in_it_may_be_missing(tmp_path):
    table = changed(changed(INFO, ["rolling_shutter_readout_s"], None), ["camera_name"], None)
    name, camera = load_camera(written(tmp_path, table, "nameless.yaml"))
    assert name == "nameless"
    assert camera.readout_s == 0.0


def test_a_kalibr_camchain_is_read(tmp_path):
    name, camera = load_camera(written(tmp_path, KALIBR, "pixel-7.yaml"))
    assert name == "pixel-7"
    assert (camera.width, camera.height, camera.model) == (1280, 720, "plumb_bob")
    assert camera.K.tolist() == [[930.0, 0.0, 646.0], [0.0, 931.0, 354.0], [0.0, 0.0, 1.0]]
    point = np.array([[2.0, 0.1, 0.1]])
    assert camera.sees(camera.pixels(point)).all()


def test_kalibrs_fisheye_is_equidistant(tmp_path):
    table = changed(KALIBR, ["cam0", "distortion_model"], "equidistant")
    assert load_camera(written(tmp_path, table))[1].model == "equidistant"


def test_a_camchains_line_delay_is_its_readout(tmp_path):
    table = changed(KALIBR, ["cam0", "line_delay"], 25e-6)
    assert load_camera(written(tmp_path, table))[1].readout_s == pytest.approx(0.018)


def test_a_camchain_may_have_our_key_for_it_but_not_both(tmp_path):
    table = changed(KALIBR, ["rolling_shutter_readout_s"], 0.018)
    assert load_camera(written(tmp_path, table))[1].readout_s == 0.018
    both = changed(table, ["cam0", "line_delay"], 25e-6)
    with pytest.raises(CameraFileError, match=r"not beside cam0\.line_delay"):
        load_camera(written(tmp_path, both))


def test_what_kalibr_says_of_motion_sensors_is_not_read(tmp_path):
    table = changed(KALIBR, ["cam0", "T_cam_imu"], [[1, 0, 0, 0]] * 4)
    assert load_camera(written(tmp_path, table))[1].readout_s == 0.0


def test_a_picture_that_stands_on_its_head_is_read_out_from_below(tmp_path):
    table = changed(INFO, ["rolling_shutter_readout_s"], -0.02)
    camera = load_camera(written(tmp_path, table))[1]
    np.testing.assert_allclose(camera.delays(np.array([[0.0, 0.0], [0.0, 720.0]])), [0.01, -0.01])


def test_a_number_that_yaml_takes_for_a_word_is_a_number(tmp_path):
    text = (CAMERAS / "virtual_phone.yaml").read_text().replace("readout_s: 0.0", "readout_s: 2e-2")
    assert load_camera(written(tmp_path, text))[1].readout_s == 0.02


def test_how_the_camera_sits_beside_its_motion_sensors_is_read(tmp_path):
    R_ci = exp(np.array([0.02, -0.03, 0.01]))
    table = {"rotation": np.round(R_ci, 6).ravel().tolist(), "time_offset_s": -0.012}
    extrinsics = load_camera(written(tmp_path, changed(INFO, ["camera_imu"], table)))[1].extrinsics
    assert extrinsics.R_ci == pytest.approx(R_ci, abs=1e-5)
    assert extrinsics.R_ci @ extrinsics.R_ci.T == pytest.approx(np.eye(3), abs=1e-12)
    assert extrinsics.time_offset_s == -0.012
    square = load_camera(written(tmp_path, INFO))[1].extrinsics
    assert (square.R_ci == np.eye(3)).all()
    assert square.time_offset_s == 0.0


IDENTITY = {"rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1]}
K = ["camera_matrix", "data"]
FAULTS = [
    (["distortion_model"], "banana", "distortion_model", "plumb_bob, rational_polynomial"),
    (["distortion_model"], "equidistant", "distortion_coefficients", "4 numbers for equidistant"),
    (["distortion_model"], None, "distortion_model", "must be there"),
    (["distortion_coefficients", "data"], [0.1] * 6, "distortion_coefficients", "4 or 5 numbers"),
    (["distortion_coefficients", "data"], [0.1, float("nan"), 0, 0], "distortion_coef", "finite"),
    (["distortion_coefficients"], None, "distortion_coefficients", "must be there"),
    (K, [930.0, 0, 646.0, 0, 931.5, 354.0, 0, 0], "camera_matrix", "9 finite numbers"),
    (K, [930.0, 0, 646.0, 0, float("inf"), 354.0, 0, 0, 1], "camera_matrix", "9 finite numbers"),
    (K, [930.0, "x", 646.0, 0, 931.5, 354.0, 0, 0, 1], "camera_matrix", "9 finite numbers"),
    (K, [[930.0, 0, 646.0], [0, 931.5, 354.0], [0, 0, 1]], "camera_matrix", "9 finite numbers"),
    (K, [-930.0, 0, 646.0, 0, 931.5, 354.0, 0, 0, 1], "camera_matrix", "fx, fy > 0"),
    (K, [930.0, 2.0, 646.0, 0, 931.5, 354.0, 0, 0, 1], "camera_matrix", "[fx, 0, cx"),
    (K, [930.0, 0, 646.0, 2.0, 931.5, 354.0, 0, 0, 1], "camera_matrix", "[fx, 0, cx"),
    (K, [930.0, 0, 646.0, 0, 931.5, 354.0, 0, 0, 2.0], "camera_matrix", "[fx, 0, cx"),
    (["camera_matrix"], 5.0, "camera_matrix", "9 finite numbers"),
    (["image_width"], None, "image_width", "must be there"),
    (["image_width"], "wide", "image_width", "a number from 16 to 8192"),
    (["image_width"], True, "image_width", "a number from 16 to 8192"),
    (["image_height"], 720.5, "image_height", "a whole number"),
    (["image_height"], 10**9, "image_height", "a number from 16 to 8192"),
    (["screen_angle_deg"], 45, "screen_angle_deg", "0, 90, 180, 270"),
    (["screen_angle_deg"], True, "screen_angle_deg", "0, 90, 180, 270"),
    (["rolling_shutter_direction"], "up", "rolling_shutter_direction", "bottom_to_top"),
    (["rolling_shutter_readout_s"], 16.0, "rolling_shutter_readout_s", "from -0.1 to 0.1"),
    (["rolling_shutter_readout_s"], float("nan"), "rolling_shutter_readout_s", "from -0.1 to 0.1"),
    (["camera_imu"], [1, 2], "camera_imu", "a mapping with rotation"),
    (["camera_imu"], {"time_offset_s": 0.0}, "camera_imu.rotation", "9 finite numbers"),
    (["camera_imu"], {"rotation": [1.0] * 9}, "camera_imu.rotation", "a rotation"),
    (
        ["camera_imu"],
        {"rotation": [-1, 0, 0, 0, 1, 0, 0, 0, 1]},
        "camera_imu.rotation",
        "a rotation",
    ),
    (["camera_imu"], {**IDENTITY, "time_offset_s": 3.0}, "camera_imu.time_offset_s", "-0.5 to 0.5"),
]


@pytest.mark.parametrize(("path", "value", "key", "allowed"), FAULTS)
def test_each_fault_names_file_key_and_what_is_allowed(tmp_path, path, value, key, allowed):
    file = written(tmp_path, changed(INFO, path, value))
    with pytest.raises(CameraFileError) as raised:
        load_camera(file)
    assert raised.value.file == str(file)
    assert key in raised.value.key
    assert allowed in raised.value.allowed
    assert str(file) in str(raised.value)


KALIBR_FAULTS = [
    (["cam0"], [1, 2], "cam0", "a mapping"),
    (["cam0", "distortion_model"], "none", "distortion_model", "radtan, equidistant"),
    (["cam0", "intrinsics"], [930.0, 931.0, 646.0], "intrinsics", "4 finite numbers"),
    (["cam0", "distortion_coeffs"], [0.1] * 5, "distortion_coeffs", "4 finite numbers"),
    (["cam0", "resolution"], [1280], "resolution", "2 finite numbers"),
    (["cam0", "resolution"], [-1280, 720], "resolution", "a number from 16 to 8192"),
    (["cam0", "resolution"], [1280.5, 720], "resolution", "a whole number"),
    (["cam0", "resolution"], None, "resolution", "must be there"),
    (["cam0", "camera_model"], "omni", "cam0.camera_model", "pinhole"),
    (["cam0", "line_delay"], 25_000.0, "cam0.line_delay", "a number from -0.000138889 to 0.000138"),
]


@pytest.mark.parametrize(("path", "value", "key", "allowed"), KALIBR_FAULTS)
def test_each_fault_of_a_camchain_is_named_too(tmp_path, path, value, key, allowed):
    with pytest.raises(CameraFileError) as raised:
        load_camera(written(tmp_path, changed(KALIBR, path, value)))
    assert key in raised.value.key
    assert allowed in raised.value.allowed


@pytest.mark.parametrize(
    "text", ["", "just words", "- a\n- list", "{unbalanced", "!!python/name:os"]
)
def test_what_is_no_yaml_mapping_is_refused(tmp_path, text):
    with pytest.raises(CameraFileError):
        load_camera(written(tmp_path, text))


def test_brackets_that_nobody_closes_are_refused_before_the_library_counts_them(
    tmp_path, monkeypatch
):
    """Of 4096 of them it makes a second's work."""
    closed = tmp_path / "closed.yaml"
    closed.write_text("a: " + 16 * "[" + 16 * "]" + "\n")
    with pytest.raises(CameraFileError, match="must be there"):
        load_camera(closed)
    monkeypatch.setattr(yaml, "safe_load", None)
    open_ones = tmp_path / "open.yaml"
    open_ones.write_text("a: " + 17 * "[")
    with pytest.raises(CameraFileError, match="lists within too many others"):
        load_camera(open_ones)


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(CameraFileError):
        load_camera(tmp_path / "missing.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(CameraFileError):
        load_camera(tmp_path / "binary.yaml")


def test_a_camera_is_found_by_device_and_size_whatever_its_spelling(tmp_path):
    written(tmp_path, changed(INFO, ["camera_name"], "Pixel 7 (back)"), "a.yaml")
    assert find_camera("pixel-7-back", 1280, 720, (CAMERAS, tmp_path)).width == 1280
    assert slug("  Pixel 7 (Back)") == "pixel-7-back"


def turned(tmp_path, angle, fu):
    table = changed(changed(INFO, ["screen_angle_deg"], angle), ["camera_name"], "pixel 7")
    table["camera_matrix"]["data"][0] = fu
    written(tmp_path, table, f"{fu}.yaml")


def test_a_calibration_of_another_screen_angle_does_not_fit(tmp_path):
    turned(tmp_path, 90, 900.0)
    turned(tmp_path, 270, 800.0)
    for angle, fu in ((90, 900.0), (270, 800.0)):
        path, camera = find_camera_file("pixel-7", 1280, 720, [tmp_path], angle)
        assert camera.K[0, 0] == fu
        assert path == tmp_path / f"{fu}.yaml"
    with pytest.raises(CameraFileError, match="pixel 7 1280x720 at 270°"):
        find_camera_file("pixel-7", 1280, 720, [tmp_path], 0)


def test_a_calibration_that_does_not_tell_its_angle_fits_any_but_comes_second(tmp_path):
    turned(tmp_path, None, 700.0)
    turned(tmp_path, 90, 900.0)
    assert find_camera_file("pixel-7", 1280, 720, [tmp_path], 0)[1].K[0, 0] == 700.0
    assert find_camera_file("pixel-7", 1280, 720, [tmp_path], 90)[1].K[0, 0] == 900.0


@pytest.mark.parametrize("wanted", [("pixel-7", 1280, 720), ("lightleash-virtual-phone", 320, 240)])
def test_a_camera_nobody_calibrated_is_refused_with_those_there_are(wanted):
    with pytest.raises(CameraFileError, match="lightleash-virtual-phone 1280x720") as raised:
        find_camera(*wanted)
    assert wanted[0] in str(raised.value)


def test_an_empty_folder_has_no_camera_at_all(tmp_path):
    with pytest.raises(CameraFileError, match="no camera at all"):
        find_camera("pixel-7", 1280, 720, (tmp_path,))


@pytest.mark.parametrize(
    ("direction", "axis", "readout_s"),
    [
        ("top_to_bottom", ROWS, 0.02),
        ("bottom_to_top", ROWS, -0.02),
        ("left_to_right", COLUMNS, 0.02),
        ("right_to_left", COLUMNS, -0.02),
    ],
)
def test_lines_are_read_in_the_direction_that_the_file_names(tmp_path, direction, axis, readout_s):
    table = changed(INFO, ["rolling_shutter_readout_s"], 0.02)
    table["rolling_shutter_direction"] = direction
    camera = load_camera(written(tmp_path, table))[1]
    assert (camera.readout_axis, camera.readout_s) == (axis, readout_s)
    assert direction_of(axis, readout_s) == direction
    chain = changed(KALIBR, ["cam0", "line_delay"], 2.5e-5)
    chain["rolling_shutter_direction"] = direction
    camera = load_camera(written(tmp_path, chain))[1]
    lines = camera.height if axis == ROWS else camera.width
    assert camera.readout_s == pytest.approx(np.sign(readout_s) * lines * 2.5e-5)


@pytest.mark.parametrize(
    ("angle", "size"), [(0, (720, 1280)), (180, (720, 1280)), (270, (1280, 720))]
)
def test_a_calibrated_camera_is_known_at_any_angle_of_the_screen(tmp_path, angle, size):
    table = changed(INFO, ["camera_name"], "pixel 7")
    table |= {"screen_angle_deg": 90, "rolling_shutter_readout_s": 0.02}
    path = written(tmp_path, table)
    found, camera = find_camera_file("pixel-7", size[0], size[1], [tmp_path], angle)
    whole = load_camera(path)[1]
    assert (found, camera.width, camera.height) == (path, *size)
    np.testing.assert_array_equal(camera.K, whole.turned((90 - angle) // 90).K)
    assert camera.readout_axis == (COLUMNS if size == (720, 1280) else ROWS)
    table |= {"screen_angle_deg": angle, "image_width": size[0], "image_height": size[1]}
    own = written(tmp_path, table, "own.yaml")
    assert find_camera_file("pixel-7", size[0], size[1], [tmp_path], angle)[0] == own


def test_a_text_that_was_read_is_not_read_through_again_and_another_one_is(tmp_path, monkeypatch):
    file = tmp_path / "phone.yaml"
    file.write_text(yaml.safe_dump(INFO | {"camera_name": "first"}))
    assert load_camera(file)[0] == "first"
    with monkeypatch.context() as once:
        once.setattr(yaml, "safe_load", None)
        assert load_camera(file)[0] == "first"
    file.write_text(yaml.safe_dump(INFO | {"camera_name": "other"}))
    assert load_camera(file)[0] == "other"
